"""Reads and writes of evidence, in as few statements as it takes; what waits: `waiting_repository`."""

from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, Table, bindparam, case, func, insert, select
from sqlalchemy.orm import Session

from experiments.checks import CHECK_CELL, CheckName
from server.models import (
    AnswerEvidence,
    AssignedTrial,
    Rating,
    RunEvent,
    StudyRun,
    TrialClip,
    VersionClip,
    View,
)
from server.prepared import Prepared, Query
from server.repository import insert_once


class Refusable(NamedTuple):
    """Events of a run that had something refused, and that had it refused for the age of its ticket alone."""

    refused: str
    expired: str


ANSWER = Refusable("answer_refused", "answer_expired")
VIEW = Refusable("view_refused", "view_expired")

_evidence = cast(Table, AnswerEvidence.__table__)
_INSERT = Prepared(insert(_evidence).inline(), _evidence.c.keys())

_views = cast(Table, View.__table__)
_as_young = case((_views.c.issued_at >= bindparam("since"), _views.c.clip_ms), else_=0.0)


class Spent(NamedTuple):
    """Clip time in ms of a run's views, and by tickets as young as one; when the first was issued."""

    run_ms: float
    batch_ms: float
    first_issued_at: datetime | None


_SPENT_BY_VIEWS = Query(
    select(
        func.coalesce(func.sum(_views.c.clip_ms), 0.0),
        func.coalesce(func.sum(_as_young), 0.0),
        func.min(_views.c.issued_at),
    ).where(_views.c.study_run_id == bindparam("run"), _views.c.issued_at.is_not(None)),
    Spent._make,
)


def first_view(connection: Connection, run: int, trial_index: int, play: int) -> datetime | None:
    """When the server heard of the first view of a play; None where it has not."""
    query = select(func.min(View.received_at)).where(
        View.study_run_id == run, View.trial_index == trial_index, View.play == play
    )
    return connection.scalar(query)


def spent_by_views(connection: Connection, run: int, since: datetime) -> Spent:
    """What the views of a run that were shown to their end took, by tickets issued from `since` on apart."""
    (spent,) = _SPENT_BY_VIEWS.all(connection, {"run": run, "since": since})
    return spent


def clip_ms_since(connection: Connection, run: int, issued_at: datetime) -> float:
    """Clip time in ms of a run's answers by tickets issued from then on."""
    of_run = (AnswerEvidence.study_run_id == run) & (AnswerEvidence.issued_at >= issued_at)
    query = select(func.coalesce(func.sum(AnswerEvidence.clip_ms), 0.0)).where(of_run)
    return float(connection.scalar(query) or 0.0)


def add(connection: Connection, values: dict[str, Any]) -> None:
    """Store the evidence of one answer."""
    _INSERT.run(connection, values)


def note_refusal(connection: Connection, run: int, event: str, code: str, moment: datetime) -> None:
    """Note that an answer was refused for this reason: once a run and reason, however many come."""
    event_id = f"{event} {code}"[:40]
    values = {"event_id": event_id, "study_run_id": run, "type": event, "received_at": moment}
    insert_once(Session(connection), RunEvent, [values | {"data": {"code": code}}])


def has_refusals(session: Session, run: StudyRun) -> bool:
    """Whether answers or views of a run were refused for their evidence."""
    query = select(RunEvent.id).where(
        RunEvent.study_run_id == run.id, RunEvent.type.in_((ANSWER.refused, VIEW.refused))
    )
    return session.scalar(query.limit(1)) is not None


def has_older_runs(session: Session, since: datetime) -> bool:
    """Whether people's runs of before there was evidence began after `since`."""
    people = StudyRun.origin.in_(("participant", "pilot"))
    query = select(StudyRun.id).where(StudyRun.evidence == "none", StudyRun.started_at > since, people)
    return session.scalar(query.limit(1)) is not None


def awaits_views_without_tickets(session: Session, since: datetime) -> bool:
    """Whether pages may be open that were loaded before views had tickets.

    There are people's runs of such pages, and the first run of a newer page began after `since`.
    """
    people = select(StudyRun.id).where(StudyRun.origin.in_(("participant", "pilot"))).limit(1)
    if session.scalar(people.where(StudyRun.view_tickets.is_(False))) is None:
        return False
    newer = people.where(StudyRun.view_tickets.is_(True), StudyRun.started_at <= since)
    return session.scalar(newer) is None


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
    trials, shown, evidence = _trials(session, run), _with_clips(session, run), _stored(session, run)
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
    """Kinds of the motion checks without an answer that stand before a trial with one."""
    rated = select(Rating.trial_index).where(Rating.study_run_id == run.id)
    last = select(func.max(Rating.trial_index)).where(Rating.study_run_id == run.id).scalar_subquery()
    query = (
        select(VersionClip.levels)
        .join(TrialClip, VersionClip.id == TrialClip.version_clip_id)
        .where(TrialClip.study_run_id == run.id, VersionClip.cell == CHECK_CELL)
        .where(TrialClip.trial_index < last, TrialClip.trial_index.not_in(rated))
    )
    return [cast(CheckName, levels["check"]) for levels in session.scalars(query)]


def _stored(session: Session, run: StudyRun) -> dict[tuple[int, int], AnswerEvidence]:
    rows = session.scalars(select(AnswerEvidence).where(AnswerEvidence.study_run_id == run.id))
    return {(row.trial_index, row.play): row for row in rows}
