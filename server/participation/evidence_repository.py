"""Reads and writes of evidence, and of digests that could not be checked when answers came."""

from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, Table, bindparam, case, func, insert, select, update
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL, CheckName
from server.core.commit import Prepared, Query
from server.core.repository import insert_once
from server.core.values import new_public_id
from server.models import (
    AnswerEvidence,
    AssignedTrial,
    Clip,
    Rating,
    RunEvent,
    SeriesAnswer,
    SeriesTrial,
    StudyRun,
    TrialClip,
    VersionClip,
    View,
)

# Reads and writes of evidence, in as few statements as it takes.


class RefusalEvents(NamedTuple):
    """Events of a run that had something refused, and that had it refused for the age of its ticket alone."""

    refused: str
    expired: str


ANSWER = RefusalEvents("answer_refused", "answer_expired")
VIEW = RefusalEvents("view_refused", "view_expired")

_evidence = cast(Table, AnswerEvidence.__table__)
# `inline`: the number of the new row is not needed, so it is not asked for.
_INSERT = Prepared(insert(_evidence).inline(), _evidence.c.keys())

_views = cast(Table, View.__table__)
# One pass over the views gives both sums.
_as_young = case((_views.c.issued_at >= bindparam("since"), _views.c.clip_ms), else_=0.0)


class ViewTime(NamedTuple):
    """Clip time in ms of a run's views, and by tickets as young as one; when the first was issued."""

    run_ms: float
    batch_ms: float
    first_issued_at: datetime | None


_SPENT_BY_VIEWS = Query(
    # Views without a ticket have no moment of issue.
    select(
        # A sum over no rows is null.
        func.coalesce(func.sum(_views.c.clip_ms), 0.0),
        func.coalesce(func.sum(_as_young), 0.0),
        func.min(_views.c.issued_at),
    ).where(_views.c.study_run_id == bindparam("run"), _views.c.issued_at.is_not(None)),
    ViewTime._make,
)


def first_view(connection: Connection, run: int, trial_index: int, play: int) -> datetime | None:
    """When the server heard of the first view of a play; None where it has not."""
    query = select(func.min(View.received_at)).where(
        View.study_run_id == run, View.trial_index == trial_index, View.play == play
    )
    return connection.scalar(query)


def spent_by_views(connection: Connection, run: int, since: datetime) -> ViewTime:
    """What the views of a run that were shown to their end took, by tickets issued from `since` on apart."""
    (spent,) = _SPENT_BY_VIEWS.all(connection, {"run": run, "since": since})
    return spent


def clip_ms_since(connection: Connection, run: int, issued_at: datetime) -> float:
    """Clip time in ms of a run's answers by tickets issued from then on."""
    of_run = (AnswerEvidence.study_run_id == run) & (AnswerEvidence.issued_at >= issued_at)
    query = select(func.coalesce(func.sum(AnswerEvidence.clip_ms), 0.0)).where(of_run)
    return float(connection.scalar(query) or 0.0)


def answers_without_digest(connection: Connection, run: int) -> int:
    """How many answers of a run to trials with clips have no digest of them."""
    # Clip time above 0: a trial without clips has nothing to take a digest of.
    is_without = AnswerEvidence.digest.is_(None) & (AnswerEvidence.clip_ms > 0)
    query = select(func.count()).where((AnswerEvidence.study_run_id == run) & is_without)
    return int(connection.scalar(query) or 0)


def add_evidence(connection: Connection, values: dict[str, Any]) -> None:
    """Store the evidence of one answer."""
    _INSERT.run(connection, values)


def note_refusal(connection: Connection, run: int, event: str, code: str, moment: datetime) -> None:
    """Note that an answer was refused for this reason: once a run and reason, however many come."""
    # The same number for the same reason, so that it is stored once; the column has 40 characters.
    event_id = f"{event} {code}"[:40]
    values = {"event_id": event_id, "study_run_id": run, "type": event, "received_at": moment}
    insert_once(Session(connection), RunEvent, [values | {"data": {"code": code}}])


def has_refusals(session: Session, run: StudyRun) -> bool:
    """Whether answers or views of a run were refused for their evidence."""
    query = select(RunEvent.id).where(
        RunEvent.study_run_id == run.id, RunEvent.type.in_((ANSWER.refused, VIEW.refused))
    )
    return session.scalar(query.limit(1)) is not None


class StoredAnswer(NamedTuple):
    """An answer with its trial, whether that has a clip, and its evidence, None where it brought none.

    Attributes
    ----------
    check : {"digit", "direction", "shape", "first_blink", "first_eye"} or None
        What kind of motion check the trial is.
    """

    rating: Any
    trial: Any
    has_clip: bool
    evidence: AnswerEvidence | None
    check: CheckName | None = None


def answers(session: Session, run: StudyRun) -> list[StoredAnswer]:
    """The answers of a run; of a rating only what is judged, since its frame log is large."""
    rated = (Rating.trial_index, Rating.play, Rating.kind, Rating.payload, Rating.rt, Rating.verdict)
    query = select(*rated, Rating.saved_at).where(Rating.study_run_id == run.id).order_by(Rating.id)
    trials, shown, evidence = _trials(session, run), _with_clips(session, run), _stored_evidence(session, run)
    # Most studies have no motion checks, which saves a query.
    checks = _checks(session, run) if any(trial.kind == "check" for trial in trials.values()) else {}
    return [
        StoredAnswer(
            row,
            trials[row.trial_index],
            row.trial_index in shown,
            evidence.get((row.trial_index, row.play)),
            checks.get(row.trial_index),
        )
        for row in session.execute(query)
    ]


def _trials(session: Session, run: StudyRun) -> dict[int, Any]:
    columns = (AssignedTrial.trial_index, AssignedTrial.kind, AssignedTrial.expected_response)
    rows = session.execute(select(*columns).where(AssignedTrial.study_run_id == run.id))
    return {row.trial_index: row for row in rows}


def _with_clips(session: Session, run: StudyRun) -> set[int]:
    return set(session.scalars(select(TrialClip.trial_index).where(TrialClip.study_run_id == run.id)))


def _checks(session: Session, run: StudyRun) -> dict[int, CheckName]:
    """Kind of check of each motion check of a run."""
    query = select(TrialClip.trial_index, VersionClip.levels).join(
        VersionClip, VersionClip.id == TrialClip.version_clip_id
    )
    rows = session.execute(query.where(TrialClip.study_run_id == run.id, VersionClip.cell == CHECK_CELL))
    return {row.trial_index: cast(CheckName, row.levels["check"]) for row in rows}


def checks_passed_over(session: Session, run: StudyRun) -> list[CheckName]:
    """Kinds of the motion checks without an answer that come before a trial with one."""
    rated = select(Rating.trial_index).where(Rating.study_run_id == run.id)
    last = select(func.max(Rating.trial_index)).where(Rating.study_run_id == run.id).scalar_subquery()
    # Order is by index: a check that comes after the last answer may still be answered.
    query = (
        select(VersionClip.levels)
        .join(TrialClip, VersionClip.id == TrialClip.version_clip_id)
        .where(TrialClip.study_run_id == run.id, VersionClip.cell == CHECK_CELL)
        .where(TrialClip.trial_index < last, TrialClip.trial_index.not_in(rated))
    )
    return [cast(CheckName, levels["check"]) for levels in session.scalars(query)]


def _stored_evidence(session: Session, run: StudyRun) -> dict[tuple[int, int], AnswerEvidence]:
    rows = session.scalars(select(AnswerEvidence).where(AnswerEvidence.study_run_id == run.id))
    return {(row.trial_index, row.play): row for row in rows}


# Reads and writes of digests that could not be checked when their answers came.

DIGESTS_CHECKED = "digests_checked"


class WaitingClip(NamedTuple):
    """A clip of an answer whose digest could not be checked when it came."""

    run: int
    trial_index: int
    play: int
    ticket: str
    digest: str
    sha256: str
    bytes: int


_trial_clips = cast(Table, TrialClip.__table__)
_chosen = cast(Table, SeriesAnswer.__table__)
_in_series = cast(Table, SeriesTrial.__table__)
_runs, _placed, _clips = (cast(Table, one.__table__) for one in (StudyRun, VersionClip, Clip))


def _same_trial(one: Table, other: Table) -> Any:
    return (one.c.study_run_id == other.c.study_run_id) & (one.c.trial_index == other.c.trial_index)


# Where answers decide on clips, that which was answered is no more the trial's if another was chosen since.
_shown = case((_in_series.c.role.is_not(None), _chosen.c.version_clip_id), else_=None)
_unchecked = (
    _evidence.c.digest.is_not(None),
    _evidence.c.digest_right.is_(None),
    _evidence.c.clip_ms > 0,
)
_UNCHECKED = (
    select(
        _evidence.c.study_run_id,
        _evidence.c.trial_index,
        _evidence.c.play,
        _evidence.c.ticket,
        _evidence.c.digest,
        _clips.c.sha256,
        _clips.c.bytes,
    )
    .select_from(
        _runs.join(_evidence, _evidence.c.study_run_id == _runs.c.id)
        .join(_trial_clips, _same_trial(_trial_clips, _evidence))
        # Outer: only trials of adaptive series have rows there.
        .outerjoin(
            _in_series, _same_trial(_in_series, _trial_clips) & (_in_series.c.role == _trial_clips.c.role)
        )
        .outerjoin(_chosen, _same_trial(_chosen, _evidence) & (_chosen.c.play == _evidence.c.play))
        # The clip that was shown, or, outside a series, the assigned one.
        .join(_placed, _placed.c.id == func.coalesce(_shown, _trial_clips.c.version_clip_id))
        .join(_clips, _clips.c.sha256 == _placed.c.clip_sha256)
    )
    .where(*_unchecked)
    # A digest is over the clips in the order of their places.
    .order_by(_evidence.c.trial_index, _evidence.c.play, _trial_clips.c.position)
)
_WAITING = Query(
    _UNCHECKED.where(_runs.c.token_hash == bindparam("token_hash"), _runs.c.status == "active"),
    WaitingClip._make,
)
_WAITING_OF_RUN = Query(_UNCHECKED.where(_runs.c.id == bindparam("run")), WaitingClip._make)
_JUDGE = Prepared(
    update(_evidence)
    .where(
        _evidence.c.study_run_id == bindparam("run"),
        _evidence.c.trial_index == bindparam("trial"),
        # Other names than those of columns, which SQLAlchemy keeps for the values of an update.
        _evidence.c.play == bindparam("of_play"),
        # Only where nothing was said yet: of two workers that judge at once, the first counts.
        _evidence.c.digest_right.is_(None),
    )
    .values(digest_right=bindparam("right"))
)


def waiting_clips(connection: Connection, token_hash: str) -> list[WaitingClip]:
    """The clips, in order, of each answer of a run whose digest is not checked yet."""
    return _WAITING.all(connection, {"token_hash": token_hash})


def waiting_of_run(connection: Connection, run: int) -> list[WaitingClip]:
    """The same of the run with this number, whether it is over or not."""
    return _WAITING_OF_RUN.all(connection, {"run": run})


def unchecked_runs(session: Session) -> list[int]:
    """The runs with answers whose digest is not checked yet."""
    query = select(_evidence.c.study_run_id).where(*_unchecked).distinct()
    return list(session.scalars(query.order_by(_evidence.c.study_run_id)))


def lock_run(session: Session, run: int) -> StudyRun:
    """The run with this number as it is stored; locked (PostgreSQL)."""
    # Read again: what the session holds may be older than the lock.
    return session.get_one(StudyRun, run, with_for_update=True, populate_existing=True)


def note_digests(session: Session, run: StudyRun, said: dict[str, Any], moment: datetime) -> None:
    """Note that digests were judged after the run was over, and what its verdict was and is."""
    event = RunEvent(event_id=new_public_id(), study_run_id=run.id, type=DIGESTS_CHECKED)
    event.received_at, event.data = moment, said
    session.add(event)


def judge_digest(connection: Connection, run: int, trial_index: int, play: int, *, right: bool) -> bool:
    """Note whether the digest of an answer is right; False where that was said before."""
    values = {"run": run, "trial": trial_index, "of_play": play, "right": right}
    # No row changed means that another worker was first.
    return _JUDGE.count(connection, values) == 1
