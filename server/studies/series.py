"""The data series of a study: versions that measure the same; and two versions compared."""

import json
import re
from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher
from itertools import groupby
from operator import itemgetter
from typing import Any, Literal

from sqlalchemy.orm import Session

from experiments.declaration.experiment import Experiment
from experiments.manifest import Clip, Manifest
from experiments.schema.difference import Change, changes_what_is_measured, difference
from server.accounts.identity import Identity
from server.core.errors import NotFound
from server.models import Study, StudyVersion
from server.studies import repository
from server.studies.lookup import active_version, definition_of, find_study, version_numbered
from server.studies.schemas import (
    ChangeOut,
    ClipDifference,
    ComparedVersion,
    Comparison,
    JudgedEdit,
    KeyDifference,
    Piece,
    PlacedClip,
    SeriesOut,
)
from video_conversion.prepared import clip_name

# The data series of a study: versions that measure the same, and whose answers may be pooled.


def series_of(session: Session, study: Study) -> list[SeriesOut]:
    """Every series of a study, oldest first, with its versions and its runs by origin."""
    runs: dict[int, dict[str, int]] = {}
    for series, origin, count in repository.runs_by_series(session, study):
        runs.setdefault(series, {})[origin] = count
    return [
        SeriesOut(number=series, versions=numbers, name=name_of(series, numbers), runs=runs.get(series, {}))
        for series, numbers in sorted(repository.versions_by_series(session, study).items())
    ]


def name_of(series: int, versions: list[int]) -> str:
    """A series in words: `series 2 (versions 3, 4)`."""
    word = "version" if len(versions) == 1 else "versions"
    return f"series {series} ({word} {', '.join(map(str, versions))})"


def version_of_series(session: Session, study: Study, series: int | None) -> StudyVersion:
    """The newest version of a series, whose scale and factors are those of all its answers.

    Where no series is given it is that of the active version.
    """
    if series is None:
        return active_version(session, study)
    version = repository.newest_of_series(session, study, series)
    if version is None:
        known = repository.versions_by_series(session, study).items()
        there = ", ".join(name_of(number, versions) for number, versions in sorted(known))
        raise NotFound(f"Study '{study.name}' has no data series {series}; there is {there}.")
    return version


def definition_of_series(session: Session, study: Study, series: int | None) -> Experiment:
    """The newest declaration of a series, or that in use; NotFound where there is no such series."""
    return definition_of(version_of_series(session, study, series))


Content = set[tuple[str, int, str]]
"""Cell, exemplar and hash of each clip."""


def content_of(clips: Sequence[Clip]) -> Content:
    """By which two versions show the same clips in the same cells, or not."""
    return {(clip.cell, clip.exemplar, clip.sha256) for clip in clips}


Sizes = dict[tuple[str, int], tuple[float | None, float | None]]
"""Width in mm and the eyes' distance in px, by cell and exemplar: what decides a clip's size on screens."""


def sizes_of(manifest: Manifest) -> Sizes:
    """The sizes of a manifest's clips."""
    eyes = manifest.inter_ocular_px
    return {(clip.cell, clip.exemplar): (clip.width_mm, eyes) for clip in manifest.clips}


def sizes_of_version(version: StudyVersion) -> Sizes:
    """The sizes of a stored version's clips."""
    eyes = version.inter_ocular_px
    return {(clip.cell, clip.exemplar): (clip.width_mm, eyes) for clip in version.clips if clip.cell}


def series_for(study: Study, experiment: Experiment, clips: Content, sizes: Sizes | None = None) -> int:
    """The series of a further version: the latest whose versions all measure the same by the same clips.

    Where there is none, a new series begins. One version is not enough: a form may be new to an older version
    and another form than that of a newer one. Sizes, as far as they are known, count where participants
    measure their screens.
    """
    if experiment.display.calibrate == "off":
        sizes = None
    by_series: dict[int, list[StudyVersion]] = {}
    for version in study.versions:
        by_series.setdefault(version.series, []).append(version)
    for series in dict.fromkeys(version.series for version in reversed(study.versions)):
        if all(
            _measures_the_same(version, experiment, clips)
            and (sizes or {}).items() <= sizes_of_version(version).items()
            for version in reversed(by_series[series])
        ):
            return series
    return max(by_series, default=0) + 1


def _measures_the_same(version: StudyVersion, experiment: Experiment, clips: Content) -> bool:
    known = {(clip.cell, clip.exemplar, clip.clip_sha256) for clip in version.clips if clip.cell}
    return known == clips and not changes_what_is_measured(difference(definition_of(version), experiment))


def effects_of_edit(
    session: Session, study: Study, experiment: Experiment, places: list[PlacedClip] | None = None
) -> JudgedEdit:
    """What saving this definition as a further version would do to the answers that are stored."""
    present = active_version(session, study)
    known = Manifest.model_validate(present.manifest).clips
    clips, sizes = content_of(known), sizes_of_version(present)
    if places is not None:
        order = experiment.factor_names
        placed = [("/".join(clip.levels.get(name, "") for name in order), clip) for clip in places]
        clips = {(cell, clip.exemplar, clip.clip_sha256) for cell, clip in placed}
        # A clip that moves keeps its size; that of an uploaded clip is known once it is saved.
        of_clip = {(clip.sha256, clip.file): (clip.width_mm, present.inter_ocular_px) for clip in known}
        sizes = {
            (cell, clip.exemplar): of_clip[key]
            for cell, clip in placed
            if (key := (clip.clip_sha256, clip_name(clip.file))) in of_clip
        }
    series = series_for(study, experiment, clips, sizes)
    runs = repository.run_count_of_series(session, study, present.series)
    changes = [
        ChangeOut(path=change.path, effect=change.effect, text=str(change))
        for change in difference(definition_of(present), experiment)
    ]
    if places is not None and (words := _moves_in_words(known, definition_of(present), places, experiment)):
        changes.append(ChangeOut(path="clips", effect="measured", text=words))
    return JudgedEdit(
        changes=changes,
        series=series,
        present_series=present.series,
        runs=runs,
        begins_series=bool(runs) and series not in {version.series for version in study.versions},
    )


def _moves_in_words(
    known: Sequence[Clip], before: Experiment, places: list[PlacedClip], after: Experiment
) -> str:
    """How many places get other clips, or how many clips go; empty where neither.

    Clips of a factor or level that only got another name stay where they are.
    """
    factors = _renamed(before.factor_names, after.factor_names)
    levels = {
        old.name: _renamed([one.name for one in old.levels], [one.name for one in new.levels])
        for old in before.factors
        for new in after.factors
        if new.name == factors[old.name]
    }

    def placed(at: dict[str, str], exemplar: int, sha256: str) -> tuple[tuple[str, ...], int, str]:
        return tuple(at.get(name, "") for name in after.factor_names), exemplar, sha256

    old_places = set()
    for clip in known:
        at = {
            factors.get(name, name): levels.get(name, {}).get(one, one) for name, one in clip.levels.items()
        }
        old_places.add(placed(at, clip.exemplar, clip.sha256))
    new_places = {placed(clip.levels, clip.exemplar, clip.clip_sha256) for clip in places}
    if moved := len(new_places - old_places):
        return "1 cell gets another clip" if moved == 1 else f"{moved} places in cells get other clips"
    gone = len(old_places - new_places)
    return "" if gone == 0 else "1 clip is removed" if gone == 1 else f"{gone} clips are removed"


def _renamed(old: Sequence[str], new: Sequence[str]) -> dict[str, str]:
    """Each old name with the new one at its position; names that only moved, or came or went, stay."""
    fits = len(old) == len(new)
    return {
        name: new[position] if fits and name not in new and new[position] not in old else name
        for position, name in enumerate(old)
    }


# Two texts as one: words that stayed, went and came.

Kind = Literal["same", "gone", "new"]
MAX_WORDS = 4000
"""Of both texts; longer ones are compared line by line, which takes time by their lines."""
_WORD = re.compile(r"\s+|\w+|[^\w\s]")
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


def word_difference(old: str, new: str) -> list[tuple[Kind, str]]:
    """Pieces of `old` and `new` in reading order; what was removed comes before what replaced it.

    Examples
    --------
    >>> word_difference("a fast clip", "a slow clip")
    [('same', 'a '), ('gone', 'fast'), ('new', 'slow'), ('same', ' clip')]
    """
    before, after = _WORD.findall(old), _WORD.findall(new)
    if len(before) + len(after) > MAX_WORDS:
        before, after = _LINE.findall(old), _LINE.findall(new)
    pieces = groupby(_pieces(before, after), key=itemgetter(0))
    return [(kind, "".join(text for _, text in group)) for kind, group in pieces]


def _pieces(before: list[str], after: list[str]) -> Iterator[tuple[Kind, str]]:
    matcher = SequenceMatcher(None, before, after, autojunk=False)
    for operation, start, end, new_start, new_end in matcher.get_opcodes():
        if operation == "equal":
            yield "same", "".join(before[start:end])
            continue
        if start < end:
            yield "gone", "".join(before[start:end])
        if new_start < new_end:
            yield "new", "".join(after[new_start:new_end])


# Two versions compared: keys of the declaration with their words, and clips.

MAX_CLIPS_LISTED = 200

Clips = dict[tuple[str, int], tuple[str, str]]
"""(cell, exemplar) -> (SHA-256, file name)."""


def compare_versions(
    session: Session, old: tuple[str, int], new: tuple[str, int], identity: Identity
) -> Comparison:
    """What differs between two versions, each given by its study's name and its number."""
    studies = {name: find_study(session, name, identity, "view") for name in dict.fromkeys((old[0], new[0]))}
    before, after = (version_numbered(session, studies[name], number) for name, number in (old, new))
    changes = difference(definition_of(before), definition_of(after))
    old_clips, new_clips = (repository.clips_by_exemplar(session, version) for version in (before, after))
    clips = list(_clips(old_clips, new_clips))
    is_sized = definition_of(after).display.calibrate != "off"
    resized = is_sized and sizes_of_version(before) != sizes_of_version(after)
    return Comparison(
        old=_side(before),
        new=_side(after),
        pooled=not clips and not resized and not changes_what_is_measured(changes),
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
    pieces = word_difference(_value_text(change.before), _value_text(change.after))
    return KeyDifference(
        path=change.path, effect=change.effect, pieces=[Piece(kind=kind, text=text) for kind, text in pieces]
    )


def _value_text(value: Any) -> str:
    """A value as it is read: texts as they are, nothing for what is not there."""
    if value is None:
        return ""
    return (
        value
        if isinstance(value, str)
        else json.dumps(_without_left_out(value), ensure_ascii=False, indent=1)
    )


def _without_left_out(value: Any) -> Any:
    """A value without the keys of its tables that were left out."""
    if isinstance(value, dict):
        given = {key: _without_left_out(item) for key, item in value.items()}
        return {key: item for key, item in given.items() if item not in (None, {}, [])}
    return [_without_left_out(item) for item in value] if isinstance(value, list) else value


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
