"""Reads and writes of digests that could not be checked when their answers came."""

from datetime import datetime
from typing import Any, NamedTuple, cast

from sqlalchemy import Connection, Table, bindparam, case, func, select, update
from sqlalchemy.orm import Session

from server.models import (
    AnswerEvidence,
    Clip,
    RunEvent,
    SeriesAnswer,
    SeriesTrial,
    StudyRun,
    TrialClip,
    VersionClip,
)
from server.prepared import Prepared, Query
from server.tokens import new_public_id

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


_evidence = cast(Table, AnswerEvidence.__table__)
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
        .outerjoin(
            _in_series, _same_trial(_in_series, _trial_clips) & (_in_series.c.role == _trial_clips.c.role)
        )
        .outerjoin(_chosen, _same_trial(_chosen, _evidence) & (_chosen.c.play == _evidence.c.play))
        .join(_placed, _placed.c.id == func.coalesce(_shown, _trial_clips.c.version_clip_id))
        .join(_clips, _clips.c.sha256 == _placed.c.clip_sha256)
    )
    .where(*_unchecked)
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
        _evidence.c.play == bindparam("of_play"),
        _evidence.c.digest_right.is_(None),
    )
    .values(digest_right=bindparam("right"))
)


def waiting(connection: Connection, token_hash: str) -> list[WaitingClip]:
    """Of each answer of a run whose digest nothing was said of, its clips in their order."""
    return _WAITING.all(connection, {"token_hash": token_hash})


def waiting_of_run(connection: Connection, run: int) -> list[WaitingClip]:
    """The same of the run with this number, whether it is over or not."""
    return _WAITING_OF_RUN.all(connection, {"run": run})


def unchecked_runs(session: Session) -> list[int]:
    """The runs with answers whose digest nothing was said of."""
    query = select(_evidence.c.study_run_id).where(*_unchecked).distinct()
    return list(session.scalars(query.order_by(_evidence.c.study_run_id)))


def lock_run(session: Session, run: int) -> StudyRun:
    """The run with this number as it is stored; locked (PostgreSQL)."""
    return session.get_one(StudyRun, run, with_for_update=True, populate_existing=True)


def note_digests(session: Session, run: StudyRun, said: dict[str, Any], moment: datetime) -> None:
    """Note that digests were judged after the run was over, and what its verdict was and is."""
    event = RunEvent(event_id=new_public_id(), study_run_id=run.id, type=DIGESTS_CHECKED)
    event.received_at, event.data = moment, said
    session.add(event)


def judge_digest(connection: Connection, run: int, trial_index: int, play: int, *, right: bool) -> bool:
    """Note whether the digest of an answer is right; False where that was said before."""
    values = {"run": run, "trial": trial_index, "of_play": play, "right": right}
    return _JUDGE.count(connection, values) == 1
