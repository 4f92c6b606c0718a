"""Tallies and the ratings they are counted from, as the database has them."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, delete, insert, select
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL
from server.models import AnswerEvidence, AssignedTrial, Rating, RunTally, StudyRun, TrialClip, VersionClip
from server.participation.tallies import COLUMNS, ClipTime, Tally, tally_of

RUNS_AT_ONCE = 100
READ_AT_ONCE = 500
"""Of a million answers 14 MB are read: memory that is used again is faster than as much new one."""
_SHOWN_PLAYS = (
    select(
        Rating.study_run_id,
        Rating.trial_index,
        Rating.play,
        Rating.kind.label("kind"),
        AssignedTrial.kind.label("part"),
        Rating.payload,
        Rating.verdict,
        Rating.verdict_rule,
        Rating.method,
        Rating.rt,
        Rating.key_to_first_frame_ms,
        StudyRun.version_id,
        TrialClip.role,
        TrialClip.version_clip_id,
    )
    .join(
        AssignedTrial,
        (AssignedTrial.study_run_id == Rating.study_run_id)
        & (AssignedTrial.trial_index == Rating.trial_index),
    )
    .join(StudyRun, StudyRun.id == Rating.study_run_id)
    # Outer, since an attention check has no clip.
    .outerjoin(
        TrialClip,
        (TrialClip.study_run_id == Rating.study_run_id) & (TrialClip.trial_index == Rating.trial_index),
    )
    .order_by(Rating.study_run_id, Rating.trial_index, Rating.play)
)


class RunCounts(NamedTuple):
    """What is stored of one run: its counts and its packed answers, both as JSON."""

    run: int
    version: int
    excluded: bool
    counts: str
    answers: str


class CellClip(NamedTuple):
    """A clip of a version with its cell."""

    id: int
    cell: str
    levels: dict[str, str]


class ShownClip(NamedTuple):
    """A stored play and one clip of its trial; role and clip are None where the trial has none."""

    run: int
    trial_index: int
    play: int
    kind: str
    part: str
    payload: dict[str, Any]
    verdict: str
    verdict_rule: str
    method: str
    rt: float | None
    onset: float | None
    version: int
    role: str | None
    clip: int | None


def counts_of(session: Session, runs: ColumnElement[bool]) -> Iterable[RunCounts]:
    """The counts of the runs that fit, read as they are asked for."""
    query = select(
        StudyRun.id, StudyRun.version_id, StudyRun.excluded, RunTally.counts, RunTally.answers
    ).join(RunTally, RunTally.study_run_id == StudyRun.id)
    # In portions: all answers at once would fill the memory.
    rows = session.execute(query.where(runs).execution_options(yield_per=READ_AT_ONCE))
    return (RunCounts._make(row) for row in rows)


def clips_of(session: Session, version: int) -> list[CellClip]:
    """The clips of a version but those of checks, by their ids."""
    query = select(VersionClip.id, VersionClip.cell, VersionClip.levels)
    query = query.where(VersionClip.version_id == version, VersionClip.cell != CHECK_CELL)
    # By id: their numbers in tallies follow from this order.
    return [CellClip(*row) for row in session.execute(query.order_by(VersionClip.id))]


def runs_after(session: Session, after: int) -> Sequence[int]:
    """The numbers of the next runs, previews too."""
    # After a number and not by offset, so that new runs move no portion.
    query = select(StudyRun.id).where(StudyRun.id > after).order_by(StudyRun.id).limit(RUNS_AT_ONCE)
    return session.scalars(query).all()


def shown_clips(session: Session, runs: Sequence[int]) -> list[ShownClip]:
    """Every play of these runs (ascending numbers) in order, one row per clip of its trial."""
    # A range instead of a list: the numbers are ascending, and few others lie between.
    query = _SHOWN_PLAYS.where(Rating.study_run_id.between(runs[0], runs[-1]))
    return [ShownClip(*row) for row in session.execute(query)]


def stored_tallies(session: Session, runs: Sequence[int]) -> dict[int, Tally]:
    """Run -> its stored tally, of these runs (ascending numbers)."""
    query = select(RunTally.study_run_id, *(getattr(RunTally, name) for name in COLUMNS))
    rows = session.execute(query.where(RunTally.study_run_id.between(runs[0], runs[-1])))
    return {run: tally_of(*columns) for run, *columns in rows}


def clip_times(session: Session, runs: Sequence[int]) -> dict[int, ClipTime]:
    """Run -> what its answers that brought tickets took of its time, of these runs (ascending numbers)."""
    row = AnswerEvidence
    query = select(row.study_run_id, row.clip_ms, row.issued_at, row.received_at)
    made: dict[int, ClipTime] = {}
    for run, clip_ms, issued_at, received_at in session.execute(
        query.where(row.study_run_id.between(runs[0], runs[-1]))
    ):
        made[run] = made.get(run, ClipTime()).plus(clip_ms, issued_at, received_at)
    return made


def lock_run(session: Session, run: int) -> None:
    """Keep a run's ratings out until the end of the transaction: they lock their run, too."""
    session.execute(select(StudyRun.id).where(StudyRun.id == run).with_for_update())


def replace_tally(session: Session, run: int, tally: Tally | None) -> None:
    """Store a run's tally in the place of what there was; None for none."""
    # Replaced, not changed: there may be none yet.
    session.execute(delete(RunTally).where(RunTally.study_run_id == run))
    if tally is not None:
        session.execute(insert(RunTally).values(study_run_id=run, **tally.values()))
