"""Visits whose time is over."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, Select, func, select
from sqlalchemy.orm import Session

from server.models import IdentityKey, Link, Study, StudyRun, StudyVersion

OF_PERSONS = ("participant", "pilot")
ERASED = "erased"
"""What stands in the place of a personal link's label."""


def studies(session: Session) -> Sequence[Study]:
    """Every study."""
    return session.scalars(select(Study).order_by(Study.id)).all()


def study_called(session: Session, name: str) -> Study | None:
    """The study of this name."""
    return session.scalar(select(Study).where(Study.name == name))


def versions(session: Session, study: Study) -> Sequence[StudyVersion]:
    """The versions of a study."""
    query = select(StudyVersion).where(StudyVersion.study_id == study.id)
    return session.scalars(query.order_by(StudyVersion.number)).all()


def _kept(version: StudyVersion) -> tuple[ColumnElement[bool], ...]:
    return (
        StudyRun.version_id == version.id,
        StudyRun.origin.in_(OF_PERSONS),
        StudyRun.erased_at.is_(None),
    )


def visits(version: StudyVersion, *, unfinished: bool) -> Select[StudyRun]:
    """The visits of a version that are not erased, or those of them that were not completed."""
    query = select(StudyRun).where(*_kept(version))
    return query.where(StudyRun.status != "complete") if unfinished else query


def identified(version: StudyVersion) -> Select[StudyRun]:
    """The visits of a version of which it is stored who took part."""
    has_id = StudyRun.id.in_(select(IdentityKey.study_run_id))
    labelled = (Link.kind == "personal") & Link.label.not_in(("", ERASED))
    known = has_id | (StudyRun.completion_code != "") | labelled
    return select(StudyRun).join(Link, Link.id == StudyRun.link_id).where(*_kept(version), known)


def numbers(session: Session, chosen: Select[StudyRun], seen_before: datetime) -> set[int]:
    """The numbers of the chosen visits that gave their last sign of life before."""
    query = chosen.where(StudyRun.last_seen_at < seen_before).with_only_columns(StudyRun.id)
    return set(session.scalars(query))


def first_seen_after(session: Session, chosen: Select[StudyRun], moment: datetime) -> datetime | None:
    """The earliest last sign of life of the chosen visits from a moment on."""
    query = chosen.where(StudyRun.last_seen_at >= moment).with_only_columns(func.min(StudyRun.last_seen_at))
    return session.scalar(query)


def batch(session: Session, chosen: Select[StudyRun], seen_before: datetime, limit: int) -> list[StudyRun]:
    """At most so many of the chosen visits, held; those that another process holds are left to it."""
    query = chosen.where(StudyRun.last_seen_at < seen_before).order_by(StudyRun.id).limit(limit)
    return list(session.scalars(query.with_for_update(of=StudyRun, skip_locked=True)))
