"""Which places of quotas and which slots of the order plan runs hold; read while the study is held."""

from collections import Counter
from collections.abc import Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy import Select, bindparam, func, literal, select, union_all
from sqlalchemy.orm import Session

from server.clock import now
from server.models import NO_SLOT, Study, StudyRun
from server.participants.repository import versions_of_series


def places_taken(session: Session, column: Any, ident: int, origin: str, lease: timedelta) -> int:
    """Runs of this origin that are complete, or active and seen within the lease; `column` equals `ident`."""
    query = select(func.count()).select_from(StudyRun).where(column == ident, *_holding(now() - lease))
    return session.scalar(query.where(StudyRun.origin == origin)) or 0


def places_by_group(session: Session, version_id: int, origin: str, lease: timedelta) -> Counter[str]:
    """Places taken as `places_taken` counts them, by group, in the data series of a version."""
    query = select(StudyRun.group_name, func.count()).where(
        StudyRun.version_id.in_(versions_of_series(version_id)),
        StudyRun.origin == origin,
        *_holding(now() - lease),
    )
    return Counter(dict(session.execute(query.group_by(StudyRun.group_name)).all()))


def complete_runs(session: Session, study: Study, origin: str) -> int:
    """Complete runs of this origin, excluded ones not counted."""
    query = (
        select(func.count())
        .select_from(StudyRun)
        .where(
            StudyRun.study_id == study.id,
            StudyRun.status == "complete",
            StudyRun.origin == origin,
            StudyRun.excluded.is_(False),
        )
    )
    return session.scalar(query) or 0


def free_slot(session: Session, version_id: int, origin: str, lease: timedelta) -> int:
    """The smallest slot that no run holds which is complete, or active and seen within the lease.

    The database looks for it: with thousands of runs, fetching their slots would take most of a start's time.
    """
    values = {"version": version_id, "origin": origin, "seen_after": now() - lease}
    return session.connection().scalar(_FREE_SLOT, values) or 0


def _holding(seen_after: Any) -> tuple[Any, ...]:
    alive = (StudyRun.status == "active") & (StudyRun.last_seen_at > seen_after)
    return (
        StudyRun.excluded.is_(False),
        (StudyRun.status == "complete") | alive,
    )


def _held(version: Any, origin: Any, seen_after: Any) -> Select[int]:
    """The slots that runs hold; those that have none yet stay aside."""
    return select(StudyRun.slot).where(
        StudyRun.version_id == version,
        StudyRun.origin == origin,
        StudyRun.slot != NO_SLOT,
        *_holding(seen_after),
    )


def _free_slot_statement() -> Any:
    taken = _held(bindparam("version"), bindparam("origin"), bindparam("seen_after")).cte("taken")
    candidates = union_all(select(literal(0).label("slot")), select(taken.c.slot + 1)).subquery()
    return select(func.min(candidates.c.slot)).where(candidates.c.slot.not_in(select(taken.c.slot)))


# Built once: the expressions cost a start more than the database's answer does.
_FREE_SLOT = _free_slot_statement()


def free_slot_of(
    session: Session, version_id: int, origin: str, lease: timedelta, groups: int, turns: Sequence[int]
) -> int:
    """As `free_slot`, among the slots that are one of `turns` modulo `groups`."""
    taken = _held(version_id, origin, now() - lease).where((StudyRun.slot % groups).in_(turns)).cte("taken")
    firsts = [select(literal(turn).label("slot")) for turn in turns]
    candidates = union_all(*firsts, select(taken.c.slot + groups)).subquery()
    free = select(func.min(candidates.c.slot)).where(candidates.c.slot.not_in(select(taken.c.slot)))
    return session.scalar(free) or 0
