"""What the monitor reads: counts of runs by the database, and the latest runs with their heat maps."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.models import Link, RunEvent, RunTally, Study, StudyRun

# Whole objects would take several times as long: this is asked every two seconds, of hundreds of runs.
SHOWN = (
    StudyRun.public_id,
    StudyRun.participant,
    StudyRun.phase,
    StudyRun.origin,
    StudyRun.status,
    StudyRun.stage,
    StudyRun.started_at,
    StudyRun.last_seen_at,
    StudyRun.completed_at,
    StudyRun.trials_total,
    StudyRun.excluded,
    StudyRun.erased_at,
    StudyRun.evidence_verdict,
    func.coalesce(RunTally.heat, "").label("heat"),
)


class RunCount(NamedTuple):
    """How many runs of one origin have one status and stage."""

    origin: str
    status: str
    stage: str
    runs: int


def run_counts(session: Session, study: Study) -> list[RunCount]:
    """The runs of a study, from an index alone."""
    kinds = (StudyRun.origin, StudyRun.status, StudyRun.stage)
    query = select(*kinds, func.count()).where(StudyRun.study_id == study.id)
    return [RunCount(*row) for row in session.execute(query.group_by(*kinds))]


def under_way(session: Session, study: Study, origin: str, seen_after: datetime) -> int:
    """Active runs of one origin that were seen after a moment."""
    query = select(func.count()).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.status == "active",
        StudyRun.last_seen_at >= seen_after,
    )
    return session.scalar(query) or 0


def by_group(
    session: Session, study: Study, origin: str, seen_after: datetime
) -> tuple[Counter[str], Counter[str]]:
    """Complete and active runs of one origin by group, without those that are excluded or silent since."""
    query = select(StudyRun.group_name, StudyRun.status, func.count()).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.excluded.is_(False),
        (StudyRun.status == "complete")
        | ((StudyRun.status == "active") & (StudyRun.last_seen_at > seen_after)),
    )
    counts = {"complete": Counter[str](), "active": Counter[str]()}
    for group, status, number in session.execute(query.group_by(StudyRun.group_name, StudyRun.status)):
        counts[status][group] += number
    return counts["complete"], counts["active"]


def completed_since(
    session: Session, study: Study, origin: str, moment: datetime
) -> tuple[int, datetime | None]:
    """Runs of one origin that were completed since a moment, and when the first of them was."""
    query = select(func.count(), func.min(StudyRun.completed_at)).where(
        StudyRun.study_id == study.id,
        StudyRun.origin == origin,
        StudyRun.status == "complete",
        StudyRun.completed_at >= moment,
    )
    number, first = session.execute(query).one()
    return number, first


def latest_runs(session: Session, study: Study, origin: str, limit: int) -> Sequence[Any]:
    """The runs of one origin that began last, in the order they began."""
    query = select(*SHOWN).outerjoin(RunTally, RunTally.study_run_id == StudyRun.id)
    query = query.where(StudyRun.study_id == study.id, StudyRun.origin == origin)
    return session.execute(query.order_by(StudyRun.id.desc()).limit(limit)).all()[::-1]


def refused_browsers(session: Session, study: Study) -> int:
    """How often a browser was refused at the door."""
    query = (
        select(func.count())
        .select_from(RunEvent)
        .join(Link, Link.id == RunEvent.link_id)
        .where(Link.study_id == study.id, RunEvent.study_run_id.is_(None))
    )
    return session.scalar(query) or 0
