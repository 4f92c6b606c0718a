"""What was shown in a run and what was answered, for the replay and for rehearsals."""

from collections.abc import Collection
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.models import (
    AssignedTrial,
    Calibration,
    Clip,
    Rating,
    RunEvent,
    Study,
    StudyRun,
    TrialClip,
    VersionClip,
    View,
    ViewClip,
)

# Reads of what was shown in a run, and of what was answered to it.

HEARTBEAT = "heartbeat"


class RoleRow(NamedTuple):
    """A clip in its role."""

    trial_index: int
    role: str
    cell: str
    exemplar: int


def assigned_trials(session: Session, run: StudyRun) -> list[AssignedTrial]:
    """The trials of a run in their order."""
    query = select(AssignedTrial).where(AssignedTrial.study_run_id == run.id)
    return list(session.scalars(query.order_by(AssignedTrial.trial_index)))


def assigned_trial(session: Session, run: StudyRun, trial_index: int) -> AssignedTrial | None:
    """One trial of a run; None where it has no such trial."""
    return session.get(AssignedTrial, (run.id, trial_index))


def roles(session: Session, run: StudyRun) -> list[RoleRow]:
    """The clips of every trial of a run, in their positions."""
    query = (
        select(TrialClip.trial_index, TrialClip.role, VersionClip.cell, VersionClip.exemplar)
        .join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .where(TrialClip.study_run_id == run.id)
        .order_by(TrialClip.trial_index, TrialClip.position)
    )
    return [RoleRow(*row) for row in session.execute(query)]


def verdicts(session: Session, run: StudyRun) -> dict[int, list[str]]:
    """The verdicts of each trial's plays, in order."""
    query = select(Rating.trial_index, Rating.verdict).where(Rating.study_run_id == run.id)
    by_trial: dict[int, list[str]] = {}
    for trial_index, verdict in session.execute(query.order_by(Rating.trial_index, Rating.play)):
        by_trial.setdefault(trial_index, []).append(verdict)
    return by_trial


def view_counts(session: Session, run: StudyRun) -> dict[int, tuple[int, int]]:
    """Trial -> (views, highest play of them)."""
    query = select(View.trial_index, func.count(), func.max(View.play)).where(View.study_run_id == run.id)
    return {index: (count, play) for index, count, play in session.execute(query.group_by(View.trial_index))}


def answers(session: Session, run: StudyRun, trial_index: int) -> list[Rating]:
    """The answers to one trial by their plays."""
    query = select(Rating).where(Rating.study_run_id == run.id, Rating.trial_index == trial_index)
    return list(session.scalars(query.order_by(Rating.play)))


def views(session: Session, run: StudyRun, trial_index: int) -> list[tuple[View, list[ViewClip]]]:
    """The views of one trial in order, each with its clips."""
    query = select(View).where(View.study_run_id == run.id, View.trial_index == trial_index)
    begun = list(session.scalars(query.order_by(View.number)))
    logged = select(ViewClip).where(ViewClip.view.in_([view.id for view in begun])).order_by(ViewClip.role)
    by_view: dict[int, list[ViewClip]] = {}
    for clip in session.scalars(logged):
        by_view.setdefault(clip.view, []).append(clip)
    return [(view, by_view.get(view.id, [])) for view in begun]


def clips_of_trial(session: Session, run: StudyRun, trial_index: int) -> list[tuple[str, VersionClip, Clip]]:
    """Role and clip of what a trial was assigned, in their positions."""
    query = (
        select(TrialClip.role, VersionClip, Clip)
        .join(VersionClip, VersionClip.id == TrialClip.version_clip_id)
        .join(Clip, Clip.sha256 == VersionClip.clip_sha256)
        .where(TrialClip.study_run_id == run.id, TrialClip.trial_index == trial_index)
        .order_by(TrialClip.position)
    )
    return [(role, placed, clip) for role, placed, clip in session.execute(query)]


def clips_by_hash(session: Session, run: StudyRun, hashes: Collection[str]) -> list[tuple[VersionClip, Clip]]:
    """Those of the clips with these hashes that the run's version has."""
    query = (
        select(VersionClip, Clip)
        .join(Clip, Clip.sha256 == VersionClip.clip_sha256)
        .where(VersionClip.version_id == run.version_id, VersionClip.clip_sha256.in_(hashes))
        .order_by(VersionClip.id)
    )
    return [(placed, clip) for placed, clip in session.execute(query)]


def events_between(session: Session, run: StudyRun, start: datetime, end: datetime) -> list[RunEvent]:
    """What happened in a run between two moments of the participant's clock, heartbeats left out."""
    query = select(RunEvent).where(
        RunEvent.study_run_id == run.id,
        RunEvent.type != HEARTBEAT,
        RunEvent.at_client >= start,
        RunEvent.at_client <= end,
    )
    return list(session.scalars(query.order_by(RunEvent.at_client, RunEvent.id)))


def px_per_mm_at(session: Session, run: StudyRun, moment: datetime) -> float | None:
    """What the latest calibration before a moment of the server's clock said."""
    query = select(Calibration.px_per_mm).where(
        Calibration.study_run_id == run.id, Calibration.saved_at <= moment
    )
    return session.scalar(query.order_by(Calibration.id.desc()).limit(1))


# What simulated people left in the sandbox.


class TrialRow(NamedTuple):
    """A clip of a trial; a trial without clips has one row without a cell."""

    trial_index: int
    kind: str
    block: str
    cell: str | None
    exemplar: int | None


def runs_of_study(session: Session, study: Study) -> list[StudyRun]:
    """The runs of a study in the order they began."""
    return list(session.scalars(select(StudyRun).where(StudyRun.study_id == study.id).order_by(StudyRun.id)))


def trials_of_run(session: Session, run: int) -> list[TrialRow]:
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
