"""Reads and writes of one rating, in as few statements as it takes."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, Table, bindparam, insert, or_, select, true, update

from server.evidence.repository import SPENT, Spent
from server.models import AssignedTrial, Rating, RunEvent, RunTally, StudyRun, TrialClip
from server.tallies.tally import Tally, tally_of
from server.trials.kinds import Part

# Tables instead of classes, and statements built once: the ORM would take twice the time of all the rest.
_runs = cast(Table, StudyRun.__table__)
_trials = cast(Table, AssignedTrial.__table__)
_clips = cast(Table, TrialClip.__table__)
_ratings = cast(Table, Rating.__table__)
_tallies = cast(Table, RunTally.__table__)

_RUN = (
    select(
        _runs.c.id,
        _runs.c.public_id,
        _runs.c.origin,
        _runs.c.evidence,
        _runs.c.version_id,
        _runs.c.status,
        _runs.c.consented_at,
        _runs.c.px_per_mm,
        _runs.c.viewing_distance_mm,
        _runs.c.trials_total,
        _runs.c.trials_answered,
        _runs.c.elapsed_ms,
    )
    .where(_runs.c.token_hash == bindparam("token_hash"))
    .with_for_update()
)
_TRIAL = (
    select(
        _trials.c.kind,
        _clips.c.role,
        _clips.c.version_clip_id,
        _tallies.c.heat,
        _tallies.c.not_good,
        _tallies.c.counts,
        _tallies.c.answers,
    )
    .select_from(
        _trials.outerjoin(_clips).outerjoin(_tallies, _tallies.c.study_run_id == _trials.c.study_run_id)
    )
    .where(_trials.c.study_run_id == bindparam("run"), _trials.c.trial_index == bindparam("trial_index"))
)
_TRIAL_AND_SPENT = _TRIAL.add_columns(*SPENT.c).join(SPENT, true())
_STORED = select(
    _ratings.c.rating_id,
    _ratings.c.trial_index,
    _ratings.c.play,
    _ratings.c.kind,
    _ratings.c.payload,
    _ratings.c.verdict,
    _ratings.c.verdict_rule,
    _ratings.c.saved_at,
).where(
    _ratings.c.study_run_id == bindparam("run"),
    or_(_ratings.c.trial_index == bindparam("trial_index"), _ratings.c.rating_id == bindparam("rating_id")),
)
_INSERT = insert(_ratings).inline()
_CHECKS = (
    select(_ratings.c.payload, _trials.c.expected_response)
    .select_from(_ratings.join(_trials))
    .where(_ratings.c.study_run_id == bindparam("run"), _trials.c.kind == "attention")
)
_LATEST = (
    select(_ratings.c.payload, _ratings.c.rt, _ratings.c.saved_at)
    .select_from(_ratings.join(_trials))
    .where(_ratings.c.study_run_id == bindparam("run"), _trials.c.kind == "main")
    .order_by(_ratings.c.id.desc())
)
_ADD_TALLY = insert(_tallies).inline()
_SET_TALLY = (
    update(_tallies)
    .where(_tallies.c.study_run_id == bindparam("run"))
    .values({name: bindparam(name) for name in ("heat", "not_good", "counts", "answers")})
)
_SEEN = (
    update(_runs)
    .where(_runs.c.id == bindparam("run"))
    .values(
        last_seen_at=bindparam("seen"),
        elapsed_ms=bindparam("elapsed"),
        trials_answered=_runs.c.trials_answered + bindparam("answered"),
    )
)


def run_for_rating(connection: Connection, token_hash: str) -> Any:
    """The columns of the run that a rating needs; None where no run has this token. Locks it (PostgreSQL)."""
    return connection.execute(_RUN, {"token_hash": token_hash}).one_or_none()


class StoredTrial(NamedTuple):
    """A trial as assigned: its part of the run, its clips' ids by role, the run's tally (None at first).

    spent: what the run's answers took of its time; None where no ticket was named.
    """

    kind: Part
    clips: dict[str, int]
    tally: Tally | None
    spent: Spent | None = None


def trial(
    connection: Connection, run: int, trial_index: int, issued_at: datetime | None = None
) -> StoredTrial | None:
    """Part and clips of a trial, with the run's tally; None where the run has no such trial.

    To be asked once the run is locked: another server may have written the tally before.
    issued_at: of the ticket that an answer names, to get with it what the run's answers took since.
    """
    values = {"run": run, "trial_index": trial_index}
    if issued_at is None:
        rows = connection.execute(_TRIAL, values).all()
    else:
        rows = connection.execute(_TRIAL_AND_SPENT, values | {"issued_at": issued_at}).all()
    if not rows:
        return None
    kind, _, _, heat, not_good, counts, answers = rows[0][:7]
    spent = rows[0][7:]
    clips = {row.role: row.version_clip_id for row in rows if row.role is not None}
    tally = None if heat is None else tally_of(heat, not_good, counts, answers)
    return StoredTrial(kind, clips, tally, Spent(*spent) if spent else None)


def stored_ratings(connection: Connection, run: int, trial_index: int, rating_id: str) -> list[Any]:
    """Ratings of this trial, and the one with this id."""
    values = {"run": run, "trial_index": trial_index, "rating_id": rating_id}
    return list(connection.execute(_STORED, values))


def add_rating(connection: Connection, values: dict[str, Any]) -> None:
    """Store one rating."""
    connection.execute(_INSERT, values)


def keep_tally(connection: Connection, run: int, tally: Tally, *, is_new: bool) -> None:
    """Store the tally of a run."""
    if is_new:
        connection.execute(_ADD_TALLY, {"study_run_id": run, **tally.values()})
    else:
        connection.execute(_SET_TALLY, {"run": run, **tally.values()})


def mark_seen(connection: Connection, run: int, seen: datetime, elapsed_ms: float, answered: int) -> None:
    """Note when the run was last seen, how far its clock is, and how many trials were settled now."""
    connection.execute(_SEEN, {"run": run, "seen": seen, "elapsed": elapsed_ms, "answered": answered})


def checks(connection: Connection, run: int) -> list[tuple[dict[str, Any], int | None]]:
    """What was answered to each attention check of a run, and what it asked for."""
    return [(row.payload, row.expected_response) for row in connection.execute(_CHECKS, {"run": run})]


def latest_answers(connection: Connection, run: int, number: int) -> list[Any]:
    """Payload, response time and moment of the latest answers to main trials, the latest first."""
    return list(connection.execute(_LATEST.limit(number), {"run": run}))


def events_of(connection: Connection, run: int, kinds: Sequence[str]) -> list[Any]:
    """Type, moment and data of the run's events of these types, in the order they came."""
    query = select(RunEvent.type, RunEvent.received_at, RunEvent.data)
    query = query.where(RunEvent.study_run_id == run, RunEvent.type.in_(kinds))
    return list(connection.execute(query.order_by(RunEvent.id)))


def event_data(connection: Connection, run: int, event_id: str) -> dict[str, Any] | None:
    """What an event says; None where there is no such event."""
    query = select(RunEvent.data).where(RunEvent.study_run_id == run, RunEvent.event_id == event_id)
    return connection.scalar(query)


def language(connection: Connection, run: int) -> str:
    """The language that the run's participant reads."""
    return str(connection.scalar(select(_runs.c.language).where(_runs.c.id == run)))


def end_run(connection: Connection, run: int, status: str) -> None:
    """Close a run with this status."""
    connection.execute(update(_runs).where(_runs.c.id == run).values(status=status))


def add_event(
    connection: Connection, run: int, event_id: str, kind: str, data: dict[str, Any], at: datetime
) -> None:
    """Store what happened in a run."""
    values = {"event_id": event_id, "study_run_id": run, "type": kind, "received_at": at, "data": data}
    connection.execute(insert(RunEvent).values(values))
