"""Reads and writes of ratings, in as few statements as it takes."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, Table, bindparam, insert, or_, select, update

from server.core.commit import Prepared, Query
from server.models import AssignedTrial, Rating, RunEvent, RunTally, StudyRun, TrialClip
from server.participation.answer_schemas import Part, RunStatus, Verdict
from server.participation.tallies import COLUMNS, Tally, tally_of

# Tables instead of classes, and statements made ready once: else they would take most of a rating's time.
_runs = cast(Table, StudyRun.__table__)
_trials = cast(Table, AssignedTrial.__table__)
_clips = cast(Table, TrialClip.__table__)
_ratings = cast(Table, Rating.__table__)
_tallies = cast(Table, RunTally.__table__)


class RunForRating(NamedTuple):
    """The columns of a run that a rating needs."""

    id: int
    public_id: str
    origin: str
    evidence: str
    version_id: int
    status: RunStatus
    consented_at: datetime | None
    px_per_mm: float | None
    viewing_distance_mm: float | None
    trials_total: int
    trials_answered: int
    elapsed_ms: float


class StoredRating(NamedTuple):
    """The columns of a stored rating that a new one is compared with."""

    rating_id: str
    trial_index: int
    play: int
    kind: str
    payload: dict[str, Any]
    verdict: Verdict
    verdict_rule: str
    saved_at: datetime


_RUN = Query(
    select(*(_runs.c[name] for name in RunForRating._fields))
    .where(_runs.c.token_hash == bindparam("token_hash"))
    # SQLite ignores it: there one writer at a time has the whole database.
    .with_for_update(),
    RunForRating._make,
)
_TRIAL = Query[tuple[Any, ...]](
    select(
        _trials.c.kind,
        _clips.c.role,
        _clips.c.version_clip_id,
        *(_tallies.c[name] for name in COLUMNS),
    )
    .select_from(
        # Outer: a trial may have no clips, and a run no tally before its first answer.
        _trials.outerjoin(_clips).outerjoin(_tallies, _tallies.c.study_run_id == _trials.c.study_run_id)
    )
    .where(_trials.c.study_run_id == bindparam("run"), _trials.c.trial_index == bindparam("trial_index"))
    # A digest is over the clips in the order of their places, which the key (by role) is not.
    .order_by(_clips.c.position),
    tuple,
)
_STORED = Query(
    select(*(_ratings.c[name] for name in StoredRating._fields)).where(
        _ratings.c.study_run_id == bindparam("run"),
        # By the id as well: the same id with another trial is a mistake to report.
        or_(
            _ratings.c.trial_index == bindparam("trial_index"),
            _ratings.c.rating_id == bindparam("rating_id"),
        ),
    ),
    StoredRating._make,
)
# The database numbers the row.
_INSERT = Prepared(insert(_ratings).inline(), [column.name for column in _ratings.c if column.name != "id"])
_CHECKS = (
    select(_ratings.c.payload, _trials.c.expected_response)
    .select_from(_ratings.join(_trials))
    .where(_ratings.c.study_run_id == bindparam("run"), _trials.c.kind == "attention")
)
_LATEST = (
    select(_ratings.c.payload, _ratings.c.rt, _ratings.c.saved_at)
    .select_from(_ratings.join(_trials))
    .where(_ratings.c.study_run_id == bindparam("run"), _trials.c.kind == "main")
    # By number, as moments of two answers may be equal.
    .order_by(_ratings.c.id.desc())
)
REFUSED = "record_refused"
"""The event of a record that can never be stored as what it was sent as."""
_REFUSED = (
    select(RunEvent.data)
    .where(RunEvent.study_run_id == bindparam("run"), RunEvent.type == REFUSED)
    .order_by(RunEvent.id)
)
_CHECK_INDICES = select(_trials.c.trial_index).where(
    _trials.c.study_run_id == bindparam("run"), _trials.c.kind == "attention"
)
_REFUSED_ID = select(RunEvent.id).where(
    RunEvent.study_run_id == bindparam("run"), RunEvent.event_id == bindparam("record")
)
_ADD_TALLY = Prepared(insert(_tallies).inline(), ("study_run_id", *COLUMNS))
_SET_TALLY = Prepared(
    update(_tallies)
    .where(_tallies.c.study_run_id == bindparam("run"))
    .values({name: bindparam(name) for name in COLUMNS})
)
_SEEN = Prepared(
    update(_runs)
    .where(_runs.c.id == bindparam("run"))
    .values(
        last_seen_at=bindparam("seen"),
        elapsed_ms=bindparam("elapsed"),
        # Added in the database, so that no older count is written back.
        trials_answered=_runs.c.trials_answered + bindparam("answered"),
    )
)


def run_for_rating(connection: Connection, token_hash: str) -> RunForRating | None:
    """The run with this token, None where there is none. Locks it (PostgreSQL)."""
    return _RUN.one_or_none(connection, {"token_hash": token_hash})


class StoredTrial(NamedTuple):
    """A trial as assigned: its part of the run, its clips' ids by role, the run's tally (None at first)."""

    kind: Part
    clips: dict[str, int]
    tally: Tally | None


def trial(connection: Connection, run: int, trial_index: int) -> StoredTrial | None:
    """Part and clips of a trial, with the run's tally; None where the run has no such trial.

    To be asked once the run is locked: another server may have written the tally before.
    """
    rows = _TRIAL.all(connection, {"run": run, "trial_index": trial_index})
    if not rows:
        return None
    # Every row repeats the kind and the tally; only the clips differ.
    kind, counted = rows[0][0], rows[0][3:]
    clips = {role: clip for _, role, clip, *_ in rows if role is not None}
    # All columns of a tally are null together, where the outer join found none.
    tally = None if counted[0] is None else tally_of(*counted)
    return StoredTrial(kind, clips, tally)


def stored_ratings(connection: Connection, run: int, trial_index: int, rating_id: str) -> list[StoredRating]:
    """Ratings of this trial, and the one with this id."""
    values = {"run": run, "trial_index": trial_index, "rating_id": rating_id}
    return _STORED.all(connection, values)


def add_rating(connection: Connection, values: dict[str, Any]) -> None:
    """Store one rating."""
    _INSERT.run(connection, values)


def keep_tally(connection: Connection, run: int, tally: Tally, *, is_new: bool) -> None:
    """Store the tally of a run."""
    if is_new:
        _ADD_TALLY.run(connection, {"study_run_id": run, **tally.values()})
    else:
        _SET_TALLY.run(connection, {"run": run, **tally.values()})


def mark_seen(connection: Connection, run: int, seen: datetime, elapsed_ms: float, answered: int) -> None:
    """Note when the run was last seen, how far its clock is, and how many trials were settled now."""
    _SEEN.run(connection, {"run": run, "seen": seen, "elapsed": elapsed_ms, "answered": answered})


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


def refused_records(connection: Connection, run: int) -> list[dict[str, Any]]:
    """What is stored of a run's records that were refused for good, in the order they came."""
    return list(connection.scalars(_REFUSED, {"run": run}))


def refused_trials(connection: Connection, run: int) -> set[int]:
    """Trials of a run whose answer was refused for good: nothing more is asked of them."""
    indices = (data.get("trial_index") for data in refused_records(connection, run))
    # A refused record may be of something else than a trial, or hold anything.
    return {index for index in indices if isinstance(index, int)}


def refused_checks(connection: Connection, run: int) -> int:
    """Attention checks of a run whose answer was refused for good, with none stored: how many."""
    refused = refused_trials(connection, run)
    if not refused:
        return 0
    stored = set(connection.scalars(select(Rating.trial_index).where(Rating.study_run_id == run)))
    # An answer stored at another attempt outweighs the refused one.
    return len(refused & set(connection.scalars(_CHECK_INDICES, {"run": run})) - stored)


def is_refused(connection: Connection, run: int, record_id: str) -> bool:
    """Whether this record is stored as refused."""
    return connection.scalar(_REFUSED_ID, {"run": run, "record": record_id}) is not None


def add_event(
    connection: Connection, run: int, event_id: str, kind: str, data: dict[str, Any], at: datetime
) -> None:
    """Store what happened in a run."""
    values = {"event_id": event_id, "study_run_id": run, "type": kind, "received_at": at, "data": data}
    connection.execute(insert(RunEvent).values(values))
