"""Reads and writes of views."""

from collections.abc import Iterable

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.models import AssignedTrial, StudyRun, View, ViewClip


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
