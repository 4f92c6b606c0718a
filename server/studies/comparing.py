"""Two versions compared: keys of the declaration with their words, and clips."""

import json
from collections.abc import Iterator
from typing import Any

from sqlalchemy.orm import Session

from experiments.schema.difference import Change, changes_what_is_measured, difference
from server.accounts.identity import Identity
from server.models import StudyVersion
from server.studies import repository
from server.studies.life_schemas import ClipDifference, ComparedVersion, Comparison, KeyDifference, Piece
from server.studies.lookup import definition_of, find_study, version_numbered
from server.studies.word_difference import word_difference

MAX_CLIPS_LISTED = 200

Clips = dict[tuple[str, int], tuple[str, str]]
"""(cell, exemplar) -> (SHA-256, file name)."""


def compare(session: Session, old: tuple[str, int], new: tuple[str, int], identity: Identity) -> Comparison:
    """What differs between two versions, each given by its study's name and its number."""
    studies = {name: find_study(session, name, identity, "view") for name in dict.fromkeys((old[0], new[0]))}
    before, after = (version_numbered(session, studies[name], number) for name, number in (old, new))
    changes = difference(definition_of(before), definition_of(after))
    old_clips, new_clips = (repository.clips_by_exemplar(session, version) for version in (before, after))
    clips = list(_clips(old_clips, new_clips))
    return Comparison(
        old=_side(before),
        new=_side(after),
        pooled=not clips and not changes_what_is_measured(changes),
        keys=[_key(change) for change in changes],
        clips=clips[:MAX_CLIPS_LISTED],
        clips_differing=len(clips),
        clips_same=len(old_clips.keys() | new_clips.keys()) - len(clips),
    )


def _side(version: StudyVersion) -> ComparedVersion:
    return ComparedVersion(
        study=version.study.name,
        version=version.number,
        series=version.series,
        created_at=version.created_at,
        note=version.note,
    )


def _key(change: Change) -> KeyDifference:
    pieces = word_difference(_said(change.before), _said(change.after))
    return KeyDifference(
        path=change.path, effect=change.effect, pieces=[Piece(kind=kind, text=text) for kind, text in pieces]
    )


def _said(value: Any) -> str:
    """A value as it is read: texts as they are, nothing for what is not there."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(_given(value), ensure_ascii=False, indent=1)


def _given(value: Any) -> Any:
    """A value without the keys of its tables that were left out."""
    if isinstance(value, dict):
        given = {key: _given(item) for key, item in value.items()}
        return {key: item for key, item in given.items() if item not in (None, {}, [])}
    return [_given(item) for item in value] if isinstance(value, list) else value


def _clips(old: Clips, new: Clips) -> Iterator[ClipDifference]:
    for position in dict.fromkeys((*old, *new)):
        before, after = old.get(position), new.get(position)
        if before is not None and after is not None and before[0] == after[0]:
            continue
        yield ClipDifference(
            kind="new" if before is None else "gone" if after is None else "replaced",
            cell=position[0],
            exemplar=position[1],
            old_file=before[1] if before else None,
            new_file=after[1] if after else None,
        )
