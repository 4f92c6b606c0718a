"""Reads and writes of the adaptive series of one run."""

from collections.abc import Iterable, Sequence
from typing import Any, cast

from sqlalchemy import Connection, Table, func, insert, select, update

from server.core.values import hash_token
from server.models import Rating, SeriesAnswer, SeriesOffer, SeriesTrial, StudyRun, TrialClip

_runs = cast(Table, StudyRun.__table__)
_ratings = cast(Table, Rating.__table__)
_clips = cast(Table, TrialClip.__table__)
_trials = cast(Table, SeriesTrial.__table__)
_offers = cast(Table, SeriesOffer.__table__)
_answers = cast(Table, SeriesAnswer.__table__)


def run_of(connection: Connection, token: str, *, lock: bool = False) -> Any:
    """Id, version, status and counts of the run with this token; None where there is none."""
    columns = (_runs.c.id, _runs.c.version_id, _runs.c.status, _runs.c.trials_total, _runs.c.trials_answered)
    query = select(*columns).where(_runs.c.token_hash == hash_token(token))
    return connection.execute(query.with_for_update() if lock else query).one_or_none()


def trial(connection: Connection, run: int, trial_index: int) -> Any:
    """The trial's place in its series; None for attention checks, which have none."""
    query = select(_trials).where(_trials.c.study_run_id == run, _trials.c.trial_index == trial_index)
    return connection.execute(query).one_or_none()


def trials(connection: Connection, run: int) -> Sequence[Any]:
    """Every trial of the run's series in order, with how many plays of it are stored."""
    # In the same statement: a trial with a stored play is no longer open.
    plays = (
        select(func.count())
        .where(_ratings.c.study_run_id == run, _ratings.c.trial_index == _trials.c.trial_index)
        .scalar_subquery()
    )
    # Practice shows a stimulus of the grid, too, but belongs to no series.
    query = select(_trials, plays.label("plays")).where(
        _trials.c.study_run_id == run, _trials.c.series.is_not(None)
    )
    return connection.execute(query.order_by(_trials.c.trial_index)).all()


def offered_clip(connection: Connection, run: int, trial_index: int, known: int) -> int | None:
    """The clip that was chosen for a trial from `known` answers; None if none was."""
    # A choice is known by how many answers it rests on, which the page sends back.
    query = select(_offers.c.version_clip_id).where(
        _offers.c.study_run_id == run, _offers.c.trial_index == trial_index, _offers.c.known == known
    )
    return connection.scalar(query)


def latest_offers(connection: Connection, run: int) -> dict[int, int]:
    """How many answers the newest choice for each trial rests on, by trial."""
    query = select(_offers.c.trial_index, func.max(_offers.c.known).label("known")).where(
        _offers.c.study_run_id == run
    )
    return {row.trial_index: row.known for row in connection.execute(query.group_by(_offers.c.trial_index))}


def answers(connection: Connection, run: int) -> Sequence[Any]:
    """The answers that count, with their series, in the order of answering."""
    query = (
        select(_trials.c.series, _answers)
        .select_from(_answers.join(_trials, _same_trial(_answers)))
        # Answers of failed plays are stored, but do not count.
        .where(_answers.c.study_run_id == run, _answers.c.counts.is_(True))
    )
    # By number, as the moments of two answers may be equal.
    return connection.execute(query.order_by(_answers.c.number)).all()


def answers_in(connection: Connection, run: int, series: str) -> int:
    """How many answers of a series count so far."""
    query = (
        select(func.count())
        .select_from(_answers.join(_trials, _same_trial(_answers)))
        .where(_answers.c.study_run_id == run, _answers.c.counts.is_(True), _trials.c.series == series)
    )
    return connection.scalar(query) or 0


def _same_trial(table: Table) -> Any:
    return (_trials.c.study_run_id == table.c.study_run_id) & (_trials.c.trial_index == table.c.trial_index)


def add_trials(connection: Connection, rows: list[dict[str, Any]]) -> None:
    """Store the places of a run's trials in their series."""
    # An insert of no rows is an insert of one row of defaults.
    if rows:
        connection.execute(insert(_trials), rows)


def add_answer(connection: Connection, values: dict[str, Any]) -> None:
    """Store what a play says to its series."""
    connection.execute(insert(_answers).inline(), values)


def add_offers(connection: Connection, rows: Iterable[dict[str, Any]]) -> None:
    """Store choices."""
    # As above: nothing to insert.
    if values := list(rows):
        connection.execute(insert(_offers), values)


def show_clip(connection: Connection, run: int, trial_index: int, role: str, clip: int) -> None:
    """Let a trial show this clip in this role."""
    where = (_clips.c.study_run_id == run, _clips.c.trial_index == trial_index, _clips.c.role == role)
    connection.execute(update(_clips).where(*where).values(version_clip_id=clip))


def note_estimate(
    connection: Connection, run: int, trial_index: int, play: int, values: dict[str, Any]
) -> None:
    """Write the estimate after an answer."""
    where = (
        _answers.c.study_run_id == run,
        _answers.c.trial_index == trial_index,
        _answers.c.play == play,
    )
    connection.execute(update(_answers).where(*where).values(**values))


def close_trials(connection: Connection, run: int, trial_indices: Sequence[int]) -> None:
    """Mark trials as needing no answer, and count them as settled."""
    where = (_trials.c.study_run_id == run, _trials.c.trial_index.in_(trial_indices))
    connection.execute(update(_trials).where(*where).values(closed=True))
    # Added in the database, so that no older count is written back.
    settled = _runs.c.trials_answered + len(trial_indices)
    connection.execute(update(_runs).where(_runs.c.id == run).values(trials_answered=settled))
