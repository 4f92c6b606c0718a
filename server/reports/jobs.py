"""Work in the background that a row of `jobs` tells of: reports and capsules."""

from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from server.accounts.identity import Identity
from server.clock import now
from server.context import Services
from server.errors import Conflict
from server.models import Job, Study
from server.reports import repository
from server.reports.process import LONGEST_S
from server.reports.repository import JobKind
from server.tokens import new_public_id


def begun(
    session: Session,
    study: Study,
    kind: JobKind,
    parameters: dict[str, Any],
    identity: Identity,
    in_the_way: str,
) -> Job:
    """A new job that waits; Conflict with the words `in_the_way` where one of its kind is under way."""
    repository.lock_study(session, study)  # two that ask at once would each see none under way
    if any(is_under_way(job) for job in repository.latest_jobs(session, study, kind)):
        raise Conflict(in_the_way)
    job = Job(
        public_id=new_public_id(),
        kind=kind,
        study_id=study.id,
        message="waiting",
        parameters=parameters,
        created_by=identity.account_id,
    )
    session.add(job)
    return job


def shown(job: Job, stopped: str) -> dict[str, Any]:
    """What the page shows of a job of any kind; `stopped` is said where the server was stopped meanwhile."""
    stale = is_abandoned(job)
    return {
        "id": job.public_id,
        "status": "failed" if stale else job.status,
        "progress": job.progress,
        "message": stopped if stale else job.message,
        "created_at": job.created_at,
    }


def note(services: Services, public_id: str, **values: Any) -> None:
    """Write how far a job is, or how it ended."""
    with services.database.write() as session:
        job = repository.job_called(session, public_id)
        if job is not None:
            for name, value in values.items():
                setattr(job, name, value)


def is_under_way(job: Job) -> bool:
    """Whether a job waits or runs."""
    return job.status in ("queued", "running") and not is_abandoned(job)


def is_abandoned(job: Job) -> bool:
    """Whether the server that ran it was stopped: no job takes this long."""
    return job.status in ("queued", "running") and now() - job.created_at > timedelta(seconds=2 * LONGEST_S)
