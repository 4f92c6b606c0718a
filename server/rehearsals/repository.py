"""What simulated people left in the sandbox."""

from typing import NamedTuple

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.models import AssignedTrial, Rating, Study, StudyRun, TrialClip, VersionClip


class TrialRow(NamedTuple):
    """A clip of a trial; a trial without clips has one row without a cell."""

    trial_index: int
    kind: str
    block: str
    cell: str | None
    exemplar: int | None


def runs(session: Session, study: Study) -> list[StudyRun]:
    """The runs of a study in the order they began."""
    return list(session.scalars(select(StudyRun).where(StudyRun.study_id == study.id).order_by(StudyRun.id)))


def trials(session: Session, run: int) -> list[TrialRow]:
    """The trials of a run in order, each with its clips."""
    query = (
        select(
            AssignedTrial.trial_index,
            AssignedTrial.kind,
            AssignedTrial.block_label,
            VersionClip.cell,
            VersionClip.exemplar,
        )
        .outerjoin(
            TrialClip,
            (TrialClip.study_run_id == AssignedTrial.study_run_id)
            & (TrialClip.trial_index == AssignedTrial.trial_index),
        )
        .outerjoin(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .where(AssignedTrial.study_run_id == run)
        .order_by(AssignedTrial.trial_index, TrialClip.position)
    )
    return [TrialRow(*row) for row in session.execute(query)]


def number_of_answers(session: Session, study: Study) -> int:
    """Stored answers of a study."""
    query = select(func.count()).select_from(Rating).join(StudyRun, StudyRun.id == Rating.study_run_id)
    return session.scalar(query.where(StudyRun.study_id == study.id)) or 0
