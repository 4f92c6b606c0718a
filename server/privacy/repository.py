"""Everything that is stored of a visit, and visits whose time is over."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Select, Table, delete, func, select
from sqlalchemy.orm import Session

from server.core.values import storable_value
from server.models import (
    Base,
    BuilderDraft,
    IdentityKey,
    Link,
    RecruiterIdentity,
    RunEvent,
    Study,
    StudyRun,
    StudyVersion,
    View,
    ViewClip,
)
from server.participation.identity_keys import identifier_hash
from server.participation.recruiter import Recruiter
from server.participation.visit_repository import of_personal_link
from server.privacy.rows import time_text


def delete_drafts(session: Session, before: datetime) -> None:
    """Delete unsaved work of the builder that was not changed since then."""
    session.execute(delete(BuilderDraft).where(BuilderDraft.saved_at < before))


# Everything that is stored of a visit, whatever table it is in.

RUN = "study_run_id"
KEYS = frozenset({"token_hash", "client_id", "sealed", "wrapped_key", "identifier_hash"})
"""Columns that open a visit or are the encrypted form of what other columns hold unencrypted."""
OF_LINKS = frozenset({"public_id", "kind", "created_at", "label"})
"""Of a link the rest is the study's: what it pays by, its key, its quota."""


def runs_known_as(session: Session, study: Study, identifier: str) -> list[StudyRun]:
    """The visits to a study under a recruiter's ID, however written, erased ones left out.

    They are found by the keyed hash of the id.
    """
    written = {identifier, *(Recruiter(kind=kind).same_id(identifier) for kind in ("generic", "mturk"))}
    hashed = [identifier_hash(study.pseudonym_key, one) for one in sorted(written)]
    query = select(StudyRun).join(RecruiterIdentity, RecruiterIdentity.study_run_id == StudyRun.id)
    query = query.where(
        StudyRun.study_id == study.id, StudyRun.erased_at.is_(None), StudyRun.origin != "preview"
    )
    return list(
        session.scalars(query.where(RecruiterIdentity.identifier_hash.in_(hashed)).order_by(StudyRun.id))
    )


def stored_rows(session: Session, run: StudyRun) -> dict[str, list[dict[str, Any]]]:
    """Table -> the rows that belong to a visit, its own and its link's included; empty tables are left out.

    Codes that pay are shown once the visit is complete.
    """
    views = select(View.id).where(View.study_run_id == run.id)
    tables = {
        "study_runs": _rows(session, StudyRun.__table__, StudyRun.id == run.id),
        "links": _rows(session, Link.__table__, Link.id == run.link_id),
        "view_clips": _rows(session, ViewClip.__table__, ViewClip.view.in_(views)),
    }
    for table in Base.metadata.sorted_tables:
        if RUN in table.columns:
            of_run = table.columns[RUN] == run.id
            events = of_run | of_personal_link(run) if table is RunEvent.__table__ else of_run
            tables[table.name] = _rows(session, table, events)
    told = {name: list(rows) for name, rows in tables.items()}
    if run.status != "complete":
        told["study_runs"][0].pop("completion_code")
    personal = run.link.kind == "personal"
    told["links"] = [
        {name: row[name] for name in row if name in OF_LINKS and (personal or name != "label")}
        for row in told["links"]
    ]
    return {name: rows for name, rows in told.items() if rows}


def _rows(session: Session, table: Any, condition: Any) -> Iterator[dict[str, Any]]:
    known: Table = table
    for row in session.execute(select(known).where(condition).order_by(*known.primary_key)).mappings():
        kept = {name: value for name, value in row.items() if name not in KEYS}
        if kept.keys() - {RUN}:
            yield {
                name: time_text(value) if hasattr(value, "isoformat") else storable_value(value)
                for name, value in kept.items()
            }


# Visits whose time is over.

OF_PERSONS = ("participant", "pilot")
ERASED = "erased"
"""What replaces the label of a personal link."""


def every_study(session: Session) -> Sequence[Study]:
    """Every study."""
    return session.scalars(select(Study).order_by(Study.id)).all()


def study_called(session: Session, name: str) -> Study | None:
    """The study of this name."""
    return session.scalar(select(Study).where(Study.name == name))


def study_versions(session: Session, study: Study) -> Sequence[StudyVersion]:
    """The versions of a study."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id)
    return session.scalars(query.order_by(StudyVersion.number)).all()


def _visits_of_version(version: StudyVersion) -> tuple[ColumnElement[bool], ...]:
    return (
        StudyRun.version_id == version.id,
        StudyRun.origin.in_(OF_PERSONS),
        StudyRun.erased_at.is_(None),
    )


def kept_visits(version: StudyVersion, *, unfinished: bool) -> Select[StudyRun]:
    """The visits of a version that are not erased, or those of them that were not completed."""
    query = select(StudyRun).where(*_visits_of_version(version))
    return query.where(StudyRun.status != "complete") if unfinished else query


def identified_visits(version: StudyVersion) -> Select[StudyRun]:
    """The visits of a version of which it is stored who took part."""
    has_id = StudyRun.id.in_(select(IdentityKey.study_run_id))
    labelled = (Link.kind == "personal") & Link.label.not_in(("", ERASED))
    known = has_id | (StudyRun.completion_code != "") | labelled
    return select(StudyRun).join(Link, Link.id == StudyRun.link_id).where(*_visits_of_version(version), known)


def numbers_due(session: Session, chosen: Select[StudyRun], seen_before: datetime) -> set[int]:
    """The numbers of the chosen visits that gave their last sign of life before."""
    query = chosen.where(StudyRun.last_seen_at < seen_before).with_only_columns(StudyRun.id)
    return set(session.scalars(query))


def first_seen_after(session: Session, chosen: Select[StudyRun], moment: datetime) -> datetime | None:
    """The earliest last sign of life of the chosen visits from a moment on."""
    query = chosen.where(StudyRun.last_seen_at >= moment).with_only_columns(func.min(StudyRun.last_seen_at))
    return session.scalar(query)


def visits_held(
    session: Session, chosen: Select[StudyRun], seen_before: datetime, limit: int
) -> list[StudyRun]:
    """Lock at most `limit` of the chosen visits; skip those that another process has locked."""
    query = chosen.where(StudyRun.last_seen_at < seen_before).order_by(StudyRun.id).limit(limit)
    return list(session.scalars(query.with_for_update(of=StudyRun, skip_locked=True)))
