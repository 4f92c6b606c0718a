"""The jobs that build reports and capsules and rehearse studies, as the database keeps them."""

from typing import Literal

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from server.models import Job, Study

JobKind = Literal["report", "capsule", "rehearsal"]
LISTED = 20


def lock_study(session: Session, study: Study) -> None:
    """Make others who ask for a job of this study wait until this transaction ends."""
    session.execute(select(Study.id).where(Study.id == study.id).with_for_update(key_share=True))


def latest_jobs(session: Session, study: Study, kind: JobKind) -> list[Job]:
    """The latest jobs of a kind for a study, newest first."""
    return jobs(session, study, kind)[:LISTED]


def jobs(session: Session, study: Study, kind: JobKind) -> list[Job]:
    """Every job of a kind for a study, newest first."""
    query = select(Job).where(Job.study_id == study.id, Job.kind == kind)
    return list(session.scalars(query.order_by(Job.id.desc())))


def find_job(session: Session, study: Study, kind: JobKind, public_id: str) -> Job | None:
    """The job of a kind for a study with this public id."""
    of_study = (Job.study_id == study.id, Job.kind == kind, Job.public_id == public_id)
    return session.scalar(select(Job).where(*of_study))


def job_called(session: Session, public_id: str) -> Job | None:
    """The job with this public id, of whatever study, kept from others until the transaction ends."""
    return session.scalar(select(Job).where(Job.public_id == public_id).with_for_update())


def status_of(session: Session, public_id: str) -> str | None:
    """How far the job with this public id is; None where there is none any more."""
    return session.scalar(select(Job.status).where(Job.public_id == public_id))


def remove_job(session: Session, study: Study, kind: JobKind, public_id: str) -> None:
    """Forget a job; its files are its own part's to remove."""
    of_study = (Job.study_id == study.id, Job.kind == kind, Job.public_id == public_id)
    session.execute(delete(Job).where(*of_study))
