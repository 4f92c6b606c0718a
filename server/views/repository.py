"""Reads and writes of views."""

from collections.abc import Iterable, Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.models import AssignedTrial, Rating, StudyRun, View, ViewClip


def trial_indices(session: Session, run: StudyRun, wanted: Iterable[int]) -> set[int]:
    """Which of these trials the run has."""
    query = select(AssignedTrial.trial_index).where(
        AssignedTrial.study_run_id == run.id, AssignedTrial.trial_index.in_(wanted)
    )
    return set(session.scalars(query))


def stored(session: Session, run: StudyRun, trials: Iterable[int]) -> list[View]:
    """The views stored of these trials."""
    return list(
        session.scalars(select(View).where(View.study_run_id == run.id, View.trial_index.in_(trials)))
    )


def add(session: Session, view: View) -> None:
    """Store a view that begins."""
    session.add(view)
    session.flush()


def add_clips(session: Session, clips: Iterable[ViewClip]) -> None:
    """Store the clips of a view that has ended."""
    session.add_all(clips)
    session.flush()


def numbers(session: Session, run: StudyRun) -> dict[int, int]:
    """The highest number of a view of each trial that has any."""
    query = select(View.trial_index, func.max(View.number).label("highest")).where(
        View.study_run_id == run.id
    )
    rows = session.execute(query.group_by(View.trial_index))
    return {row.trial_index: row.highest for row in rows}


def unanswered(session: Session, run: StudyRun) -> Sequence[View]:
    """Views of plays that have no answer, in the order of their trials and numbers."""
    answered = select(Rating.id).where(
        Rating.study_run_id == View.study_run_id,
        Rating.trial_index == View.trial_index,
        Rating.play == View.play,
    )
    query = select(View).where(View.study_run_id == run.id, ~answered.exists())
    return session.scalars(query.order_by(View.trial_index, View.number)).all()


def clips_of(session: Session, views: Iterable[View]) -> dict[int, list[ViewClip]]:
    """The clips of each of these views."""
    found: dict[int, list[ViewClip]] = {}
    for clip in session.scalars(select(ViewClip).where(ViewClip.view.in_([view.id for view in views]))):
        found.setdefault(clip.view, []).append(clip)
    return found
