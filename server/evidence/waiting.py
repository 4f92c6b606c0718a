"""Digests of clips that the server had not read yet when they were answered: judged as soon as they can be.

Clips of an object store are read in the background from the moment a run gets its tickets. Who answers sooner
is taken at their word until the end of the run, whose verdict then rests on every digest that could be
checked. Where the store is away at that moment, or slow, the rest are judged when it answers again: the
verdict is given anew, and an event of the run says so. Of several workers that look at once, the first to
store counts; the others change nothing and note nothing.
"""

import hmac
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from hashlib import sha256 as by_sha256
from itertools import groupby

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from server.clock import now
from server.db import Database
from server.evidence import waiting_repository
from server.evidence.clip_bytes import ClipBytes, clip_digest
from server.evidence.intake import Intake
from server.evidence.service import judge_run
from server.evidence.waiting_repository import WaitingClip
from server.models import StudyRun
from server.tokens import hash_token

LIMIT_S = 5.0
"""How long clips are read for at the end of a run; what could not be had by then is judged later."""
LATER_LIMIT_S = 20.0
"""How long they are read for where nobody waits, a run."""

AnswerKey = tuple[int, int, int]
"""Run, trial and play."""


def judge_waiting(database: Database, intake: Intake, token: str) -> None:
    """Judge the digests of a run that nothing was said of; clips are read while no transaction is open."""
    token_hash = hash_token(token)
    with database.read() as session:
        waiting = waiting_repository.waiting(session.connection(), token_hash)
    judged = _judged(intake.clips, waiting, time.monotonic() + LIMIT_S, set())
    if judged:
        with database.write_connection() as connection:
            _stored(connection, judged)
    if len(judged) < _answers(waiting):
        intake.unchecked.set()


def judge_later(database: Database, clips: ClipBytes, stopped: Callable[[], bool] = lambda: False) -> int:
    """Judge the digests of all runs, and those that are over anew; return how many answers stay unchecked.

    Parameters
    ----------
    stopped : callable, optional
        Asked between two runs; once true no further one is looked at.
    """
    with database.read() as session:
        runs = waiting_repository.unchecked_runs(session)
    away: set[str] = set()
    return sum(_judge_run_later(database, clips, run, away) for run in runs if not stopped())


def _judge_run_later(database: Database, clips: ClipBytes, run_id: int, away: set[str]) -> int:
    with database.read() as session:
        waiting = waiting_repository.waiting_of_run(session.connection(), run_id)
    judged = _judged(clips, waiting, time.monotonic() + LATER_LIMIT_S, away)
    if judged:
        with database.write() as session:
            run = waiting_repository.lock_run(session, run_id)
            stored = _stored(session.connection(), judged)
            if stored and run.evidence_verdict is not None and run.erased_at is None:
                _judge_again(session, run, stored)
    return _answers(waiting) - len(judged)


def _judge_again(session: Session, run: StudyRun, judged: Mapping[AnswerKey, bool]) -> None:
    """Give a run that is over its verdict by the digests as well, and note what it was before."""
    before, run.evidence_verdict = run.evidence_verdict, judge_run(session, run).verdict
    wrong = sum(not right for right in judged.values())
    said = {"answers": len(judged), "wrong": wrong, "before": before, "verdict": run.evidence_verdict}
    waiting_repository.note_digests(session, run, said, now())


def _answers(waiting: Iterable[WaitingClip]) -> int:
    return len({_key_of(clip) for clip in waiting})


def _key_of(clip: WaitingClip) -> AnswerKey:
    """The answer that a clip was shown for."""
    return clip.run, clip.trial_index, clip.play


def _judged(
    clips: ClipBytes, waiting: Iterable[WaitingClip], limit: float, away: set[str]
) -> dict[AnswerKey, bool]:
    """Whether the digest of each answer is right, of those whose clips were had by `limit`.

    Clips that were not had are added to those `away`, which are asked for no more: a store may take seconds
    to give no answer.
    """
    judged = {}
    for answer, group in groupby(waiting, _key_of):
        shown = list(group)
        hashes = {clip.sha256 for clip in shown}
        if time.monotonic() >= limit or hashes & away:
            continue
        right = _is_right(clips, shown, limit)
        if right is None:
            away |= hashes
        else:
            judged[answer] = right
    return judged


def _stored(connection: Connection, judged: Mapping[AnswerKey, bool]) -> dict[AnswerKey, bool]:
    """Store what was made of the digests; those of which another worker had said nothing meanwhile."""
    return {
        answer: right
        for answer, right in judged.items()
        if waiting_repository.judge_digest(connection, *answer, right=right)
    }


def _is_right(clips: ClipBytes, shown: Sequence[WaitingClip], limit: float) -> bool | None:
    """Whether an answer's digest is that of its clips, also as older pages make it; None: not to be had."""
    hashes = [clips.hash_now(clip.sha256, clip.bytes, limit) for clip in shown]
    at_hand = [one for one in hashes if one is not None]
    if len(at_hand) < len(hashes):
        return None
    ticket, digest = shown[0].ticket, shown[0].digest
    if clip_digest(ticket, *at_hand) == digest:
        return True
    older = hmac.new(ticket.encode(), digestmod=by_sha256)
    for clip in shown:
        if not clips.feed(clip.sha256, clip.bytes, older.update, limit):
            return None
    return older.hexdigest() == digest
