"""The stored comparisons of a data series, for designs that choose the next pairs by them."""

from datetime import timedelta
from typing import Literal, get_args

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import Session, aliased

from experiments.assignment.compared import Compared
from server.clock import now
from server.models import AssignedTrial, Rating, StudyRun, TrialClip, VersionClip
from server.participants.repository import versions_of_series

Winner = Literal["left", "right", "tie"]


def compared(session: Session, version_id: int, origin: str, lease: timedelta) -> list[Compared]:
    """What was answered, and what was dealt to people seen within the lease who have not answered it yet.

    Of runs of this origin that are not excluded; failed plays are no answers. Ordered, so that equal stored
    comparisons give an equal list.
    """
    first, second = aliased(TrialClip), aliased(TrialClip)
    winner = Rating.payload["winner"].as_string().label("winner")
    alive = and_(StudyRun.status == "active", StudyRun.last_seen_at > now() - lease)
    query = (
        select(first.version_clip_id, second.version_clip_id, winner, func.count())
        .select_from(StudyRun)
        .join(AssignedTrial, AssignedTrial.study_run_id == StudyRun.id)
        .join(first, _of_trial(first, 0))
        .join(second, _of_trial(second, 1))
        .outerjoin(
            Rating,
            and_(
                Rating.study_run_id == AssignedTrial.study_run_id,
                Rating.trial_index == AssignedTrial.trial_index,
                Rating.verdict != "failed",
            ),
        )
        .where(
            StudyRun.version_id.in_(versions_of_series(version_id)),
            StudyRun.origin == origin,
            StudyRun.excluded.is_(False),
            StudyRun.status.in_(("active", "complete")),
            AssignedTrial.kind == "main",
            Rating.id.is_not(None) | alive,
        )
        .group_by(first.version_clip_id, second.version_clip_id, "winner")
    )
    names = _names(session, version_id)
    rows = [
        Compared(names[left], names[right], answer if answer in get_args(Winner) else None, times)
        for left, right, answer, times in session.execute(query)
    ]
    return sorted(rows, key=lambda row: (row.left, row.right, row.winner or ""))


def _of_trial(clip: type[TrialClip], position: int) -> ColumnElement[bool]:
    return and_(
        clip.study_run_id == AssignedTrial.study_run_id,
        clip.trial_index == AssignedTrial.trial_index,
        clip.position == position,
    )


def _names(session: Session, version_id: int) -> dict[int, str]:
    """Clips of the series as lists name them; the versions of a series show the same clips."""
    query = select(VersionClip.id, VersionClip.cell, VersionClip.exemplar)
    rows = session.execute(query.where(VersionClip.version_id.in_(versions_of_series(version_id))))
    return {number: f"{cell}/{exemplar}" for number, cell, exemplar in rows}
