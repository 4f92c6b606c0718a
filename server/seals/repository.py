"""What sealing asks of the database: who took part, and the seal in the audit log."""

from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.models import AuditEntry, Study, StudyRun, StudyVersion


def people_of_series(session: Session, study: Study, series: int) -> int:
    """Runs of participants of this data series."""
    query = (
        select(func.count(StudyRun.id))
        .join(StudyVersion, StudyVersion.id == StudyRun.version_id)
        .where(StudyRun.study_id == study.id, StudyRun.origin == "participant", StudyVersion.series == series)
    )
    return session.scalar(query) or 0


def sealed_document(session: Session, study: str, series: int, action: str) -> dict[str, Any] | None:
    """The seal that the audit log keeps of this study's data series.

    What was sealed of a deleted study is no seal of a later one that has its name.
    """
    of_study = (AuditEntry.target_kind == "study", AuditEntry.target == study)
    deleted = select(func.max(AuditEntry.id)).where(*of_study, AuditEntry.action == "study deleted")
    query = select(AuditEntry).where(
        *of_study, AuditEntry.action == action, AuditEntry.id > (session.scalar(deleted) or 0)
    )
    for entry in session.scalars(query.order_by(AuditEntry.id)):
        if entry.details.get("series") == series:
            return dict(entry.details["seal"])
    return None
