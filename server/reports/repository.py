"""The jobs that build reports, as the database keeps them."""

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.models import Job, Study

KIND = "report"
LISTED = 20


def latest_reports(session: Session, study: Study) -> list[Job]:
    """The latest reports of a study, newest first."""
    query = select(Job).where(Job.study_id == study.id, Job.kind == KIND)
    return list(session.scalars(query.order_by(Job.id.desc()).limit(LISTED)))


def find_report(session: Session, study: Study, public_id: str) -> Job | None:
    """The report of a study with this public id."""
    return session.scalar(select(Job).where(Job.study_id == study.id, Job.public_id == public_id))


def job_called(session: Session, public_id: str) -> Job | None:
    """The job with this public id, of whatever study."""
    return session.scalar(select(Job).where(Job.public_id == public_id))
