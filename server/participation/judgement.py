"""The judgement on stored runs, and on digests that could not be checked at once."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager
from itertools import groupby

from sqlalchemy import Connection
from sqlalchemy.orm import Session

from experiments.assignment.order import attention_by_block, motion_checks_by_block
from experiments.checks import CHECK_KINDS
from experiments.declaration.experiment import Experiment
from experiments.kinds import KINDS
from server.core.changes import Stopped, background_task
from server.core.db import Database
from server.core.values import hash_token, now
from server.models import StudyRun
from server.participation import evidence_repository, rating_repository
from server.participation.clip_hashes import ClipHashes, clip_digest
from server.participation.evidence import NOT_JUDGED, JudgedAnswer, Judgement, comparable_answer, judge
from server.participation.evidence_repository import WaitingClip
from server.participation.intake import Intake
from server.studies.lookup import definition_of

# The judgment on a stored run.


def judge_run(session: Session, run: StudyRun) -> Judgement:
    """The judgement on a run as it is stored; runs whose page was not asked for evidence are not judged."""
    # Only counts are left of an erased run: a new verdict would have no data.
    if run.evidence != "asked" or run.erased_at is not None:
        return NOT_JUDGED
    rows = evidence_repository.answers(session, run)
    unstored = rating_repository.refused_checks(session.connection(), run.id)
    offered = _choices_offered(run) if unstored or any(row.trial.kind == "attention" for row in rows) else 0
    answers = [_answer(row, offered) for row in rows]
    passed_over = [
        len(CHECK_KINDS[check].choices) for check in evidence_repository.checks_passed_over(session, run)
    ]
    return judge(
        answers,
        refused=evidence_repository.has_refusals(session, run),
        passed_over=passed_over,
        unstored_checks=[offered] * unstored,
    )


def guessed_throughout(experiment: Experiment) -> float:
    """How likely guesses are right in every attention and motion check that a run of a study has."""
    kinds = experiment.evidence.motion_checks.kinds
    fewest = min(len(CHECK_KINDS[kind].choices) for kind in kinds)
    questions, clips = sum(attention_by_block(experiment)), sum(motion_checks_by_block(experiment))
    offered = KINDS[experiment.trial.kind].check_choices(experiment)
    guesses: int = offered**questions * fewest**clips
    return 1 / guesses


def _choices_offered(run: StudyRun) -> int:
    """How many answers an attention check of the run's study offers."""
    experiment = definition_of(run.version)
    return KINDS[experiment.trial.kind].check_choices(experiment)


def _answer(row: evidence_repository.StoredAnswer, offered: int) -> JudgedAnswer:
    evidence, trial = row.evidence, row.trial
    response, choices = comparable_answer(row.rating.payload), 0
    if trial.kind == "attention":
        response, choices = KINDS[row.rating.kind].check_response(row.rating.payload), offered
    if trial.kind == "check":
        response = row.rating.payload.get("check")
    given = (evidence.interaction if evidence else None) or {}
    # A digest that nobody could check counts neither for nor against the run.
    unchecked = evidence is not None and evidence.digest is not None and evidence.digest_right is None
    return JudgedAnswer(
        trial_index=trial.trial_index,
        play=row.rating.play,
        part=trial.kind,
        response=response,
        expected=trial.expected_response,
        rt=row.rating.rt,
        clip_ms=evidence.clip_ms if evidence else 0.0,
        needs_digest=response is not None and row.has_clip and not unchecked,
        received_at=evidence.received_at if evidence else row.rating.saved_at,
        issued_at=evidence.issued_at if evidence else None,
        digest_right=evidence.digest_right if evidence else None,
        late=bool(evidence and evidence.late),
        presses=given.get("presses"),
        trusted=given.get("trusted"),
        press_ms=given.get("press_ms"),
        choices=len(CHECK_KINDS[row.check].choices) if row.check else choices,
        void=row.check is not None and row.rating.verdict == "failed",
        other_way=trial.kind == "check" and bool(row.rating.payload.get("other_way")),
    )


# Digests of clips that the server had not read yet when they were answered: judged as soon as they can be.
#
# Clips of an object store are read in the background from the moment a run gets its tickets. Who answers
# sooner is taken at their word until the end of the run, whose verdict then rests on every digest that
# could be checked. Where the store is away at that moment, or slow, the rest are judged when it answers
# again: the verdict is given again, and an event of the run records it. Of several workers that look at once,
# the first to store counts; the others change nothing and note nothing.

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
        waiting = evidence_repository.waiting_clips(session.connection(), token_hash)
    judged = _judge_digests(intake.clips, waiting, time.monotonic() + LIMIT_S, set())
    if judged:
        with database.write_connection() as connection:
            _store_judged(connection, judged)
    if len(judged) < _answers(waiting):
        intake.unchecked.set()


def judge_later(database: Database, clips: ClipHashes, stopped: Callable[[], bool] = lambda: False) -> int:
    """Judge the digests of all runs, again those that are over; return how many answers stay unchecked.

    Parameters
    ----------
    stopped : callable, optional
        Asked between two runs; once true no further one is looked at.
    """
    with database.read() as session:
        runs = evidence_repository.unchecked_runs(session)
    away: set[str] = set()
    return sum(_judge_run_later(database, clips, run, away) for run in runs if not stopped())


def _judge_run_later(database: Database, clips: ClipHashes, run_id: int, away: set[str]) -> int:
    with database.read() as session:
        waiting = evidence_repository.waiting_of_run(session.connection(), run_id)
    judged = _judge_digests(clips, waiting, time.monotonic() + LATER_LIMIT_S, away)
    if judged:
        with database.write() as session:
            # Locked before the digests are stored: the run's end must not give its verdict between the two.
            run = evidence_repository.lock_run(session, run_id)
            stored = _store_judged(session.connection(), judged)
            # A run that is open gets its verdict at its end, and of an erased one nothing is left to judge.
            if stored and run.evidence_verdict is not None and run.erased_at is None:
                _judge_again(session, run, stored)
    return _answers(waiting) - len(judged)


def _judge_again(session: Session, run: StudyRun, judged: Mapping[AnswerKey, bool]) -> None:
    """Give a run that is over its verdict by the digests as well, and note what it was before."""
    before, run.evidence_verdict = run.evidence_verdict, judge_run(session, run).verdict
    wrong = sum(not right for right in judged.values())
    said = {"answers": len(judged), "wrong": wrong, "before": before, "verdict": run.evidence_verdict}
    evidence_repository.note_digests(session, run, said, now())


def _answers(waiting: Iterable[WaitingClip]) -> int:
    return len({_key_of(clip) for clip in waiting})


def _key_of(clip: WaitingClip) -> AnswerKey:
    """The answer that a clip was shown for."""
    return clip.run, clip.trial_index, clip.play


def _judge_digests(
    clips: ClipHashes, waiting: Iterable[WaitingClip], limit: float, away: set[str]
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


def _store_judged(connection: Connection, judged: Mapping[AnswerKey, bool]) -> dict[AnswerKey, bool]:
    """Store what was made of the digests; those of which another worker had said nothing meanwhile."""
    return {
        answer: right
        for answer, right in judged.items()
        if evidence_repository.judge_digest(connection, *answer, right=right)
    }


def _is_right(clips: ClipHashes, shown: Sequence[WaitingClip], limit: float) -> bool | None:
    """Whether an answer's digest is that of its clips; None: they are not to be had."""
    hashes = [clips.hash_now(clip.sha256, clip.bytes, limit) for clip in shown]
    at_hand = [one for one in hashes if one is not None]
    if len(at_hand) < len(hashes):
        return None
    return clip_digest(shown[0].ticket, *at_hand) == shown[0].digest


# Digests that wait for the clip store are judged while the server runs, once the store answers again.

LOG = logging.getLogger(__name__)
LOOK_EVERY_S, MAX_WAIT_S = 60.0, 600.0
"""Between two looks; twice as long after each that could judge nothing, up to the latter."""


def digests_judged_later(
    database: Database, intake: Intake, look_every_s: float = LOOK_EVERY_S
) -> AbstractAsyncContextManager[None]:
    """Judge what waits from before the server started, and whatever answer it had to take unchecked."""
    return background_task(lambda stopped: _watch(database, intake, look_every_s, stopped))


async def _watch(database: Database, intake: Intake, look_every_s: float, stopped: Stopped) -> None:
    wait_s, left = look_every_s, 0
    while True:
        await asyncio.sleep(wait_s)
        if not intake.unchecked.is_set() and not left:
            continue
        # Nothing new since the last look: what is left waits for a store that is away, so look ever less.
        wait_s = look_every_s if intake.unchecked.is_set() else min(2 * wait_s, MAX_WAIT_S)
        # Cleared before the look and not after it: an answer that comes meanwhile must cause another one.
        intake.unchecked.clear()
        try:
            before, left = left, await asyncio.to_thread(judge_later, database, intake.clips, stopped)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("digests of clips")
            intake.unchecked.set()
            continue
        # Some could be judged: the store answers again.
        if left < before:
            wait_s = look_every_s
