"""What an answer must bring along to be stored: its ticket, time enough, and the digest of its clip."""

import threading
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property
from typing import Any, Protocol

from sqlalchemy import Connection

from server.errors import ApiError
from server.evidence import repository
from server.evidence.clip_bytes import ClipBytes, clip_digest, older_digest
from server.evidence.clip_time import ClipTime
from server.evidence.refusals import (
    ClipsOutlastTickets,
    DigestDiffers,
    DigestMissing,
    TicketExpired,
    TicketMissing,
)
from server.evidence.schemas import RatingEvidence
from server.evidence.tickets import Batch, check_ticket, evidence_key
from server.rate_limit import RateLimit
from server.settings import Settings

SLACK_MS = 1_000.0
SLACK_SHARE = 0.02
"""How much longer the clips may last than the time there was: no screen keeps quite the server's time."""
LATE = timedelta(seconds=60)
_MILLISECOND = timedelta(milliseconds=1)
FALSE_ANSWERS_PER_MINUTE = 60
ENFORCED_ORIGINS = ("participant", "pilot")


class Sent(Protocol):
    """Something of a run that carries a ticket."""

    @property
    def run(self) -> int:
        """The run's row."""

    @property
    def run_id(self) -> str:
        """The run's public id."""

    @property
    def received_at(self) -> datetime:
        """When it came, by the server's clock."""


@dataclass(frozen=True)
class Answer:
    """One answer as it comes in.

    Attributes
    ----------
    clips : tuple of (str, int)
        Hash and size of each clip of the trial, in order.
    clip_ms : float
        How long they last, at once or in turn with what is between, over all views; 0 where nothing was
        rated.
    received_at : datetime
        By the server's clock.
    answered_at : datetime or None
        By the client's.
    """

    run: int
    run_id: str
    origin: str
    trial_index: int
    play: int
    rated: bool
    clips: tuple[tuple[str, int], ...]
    clip_ms: float
    received_at: datetime
    answered_at: datetime | None
    evidence: RatingEvidence | None


class Intake:
    """Checks what comes with answers, for one server.

    Attributes
    ----------
    refuses : bool
        False where what breaks a rule is stored and judged instead.
    rehearses : bool
        True where simulated runs are treated as people's.
    unchecked : threading.Event
        Set where answers may be stored whose digests could not be checked: at first, since nothing is known.
    """

    def __init__(self, settings: Settings, clips: ClipBytes, *, rehearses: bool = False) -> None:
        self._settings, self.clips, self.rehearses = settings, clips, rehearses
        self.refuses = settings.evidence == "refuse"
        self.unchecked = threading.Event()
        self.unchecked.set()
        self._false_answers = RateLimit(FALSE_ANSWERS_PER_MINUTE)

    @cached_property
    def key(self) -> bytes:
        """The key of the tickets; the secret key behind it is made at its first use, not before."""
        return evidence_key(self._settings.key)

    def take(
        self, connection: Connection, answer: Answer, before: ClipTime, *, stores: bool = True
    ) -> ClipTime:
        """Store the evidence of an answer; refused by name where it cannot have been given so.

        Of what the run's answers took of its time before, makes what they took with this one. Without
        `stores` it is checked alone: of an answer that is kept as refused.

        Where nothing is refused, evidence that does not hold is left out: the answer then counts as without.
        """
        enforced = self.enforces(answer.origin)
        try:
            batch, given = self._batch(answer, answer.evidence)
            late = _in_time(connection, answer, batch, before)
            right = self._digest(answer, given)
        except ApiError as refusal:
            if enforced:
                self.note(connection, answer, refusal, repository.ANSWER)
                raise
            return before
        if not stores:
            return before.plus(answer.clip_ms, batch.issued_at, answer.received_at)
        repository.add(connection, _row(answer, batch, given, late=late, digest_right=right))
        if right is None and given.digest is not None:
            self.unchecked.set()
        return before.plus(answer.clip_ms, batch.issued_at, answer.received_at)

    def enforces(self, origin: str) -> bool:
        """Whether what breaks a rule is refused in runs of this origin."""
        return self.refuses and (origin in ENFORCED_ORIGINS or self.rehearses)

    def note(
        self, connection: Connection, sent: "Sent", refusal: ApiError, what: repository.Refusable
    ) -> None:
        """Note once a run that something of it was refused for this reason, and limit how often it may be."""
        # Each run has a share of its own: who sends false answers hinders nobody else.
        self._false_answers.hit(sent.run_id)
        # A page that stood open for months sends nothing false: noted, and no word on the run.
        event = what.expired if isinstance(refusal, TicketExpired) else what.refused
        repository.note_refusal(connection, sent.run, event, refusal.code, sent.received_at)

    def _batch(self, answer: Answer, given: RatingEvidence | None) -> tuple[Batch, RatingEvidence]:
        if given is None:
            raise TicketMissing("Expected a ticket with the answer, got none; please load the page again.")
        where = (answer.run_id, answer.trial_index, answer.play)
        # By the client's word, which only tells a late delivery: so old a ticket leaves time for any clip.
        given_at = min(answer.received_at, answer.answered_at or answer.received_at)
        return check_ticket(self.key, given.batch, given.ticket, *where, given_at), given

    def _digest(self, answer: Answer, given: RatingEvidence) -> bool | None:
        """True where the digest is right; None where none is needed, or the clip is not at hand."""
        if not answer.clips or not answer.rated:
            return None
        if given.digest is None:
            raise DigestMissing("Expected a digest of the clip with its rating, got none; nothing is stored.")
        hashes = [self.clips.hash_at_once(sha256, size) for sha256, size in answer.clips]
        at_hand = [one for one in hashes if one is not None]
        if len(at_hand) < len(hashes):
            return None
        right = True if clip_digest(given.ticket, *at_hand) == given.digest else self._is_older(answer, given)
        if right is False:
            raise DigestDiffers("Expected the digest of this trial's clip, got another; nothing is stored.")
        return right

    def _is_older(self, answer: Answer, given: RatingEvidence) -> bool | None:
        """Whether the digest is right as a page makes it that was open before the last upgrade.

        None where the clips' bytes are not at hand: then nothing can be said.
        """
        clips = [self.clips.at_once(sha256, size) for sha256, size in answer.clips]
        at_hand = [one for one in clips if one is not None]
        if len(at_hand) < len(clips):
            return None
        return older_digest(given.ticket, b"".join(at_hand)) == given.digest


def _in_time(connection: Connection, answer: Answer, batch: Batch, before: ClipTime) -> bool:
    """Whether the answer came late; ClipsOutlastTickets where its clips cannot have been seen by then."""
    first = min(filter(None, (before.first_issued_at, batch.issued_at)))
    of_batch = before.since(batch.issued_at)
    if of_batch is None:  # tickets of a page before a reload, after answers by those of a page after it
        of_batch = repository.clip_ms_since(connection, answer.run, batch.issued_at)
    for issued_at, before_ms in ((batch.issued_at, of_batch), (first, before.clip_ms)):
        needed, there_was = before_ms + answer.clip_ms, milliseconds(answer.received_at - issued_at)
        if too_short(needed, there_was) and not _seen_before(connection, answer, issued_at, before_ms):
            raise ClipsOutlastTickets(
                f"Clips of {needed / 1000:.1f} s cannot have been watched in the {there_was / 1000:.1f} s "
                "since their tickets were issued; nothing is stored.",
                needed_ms=needed,
                there_was_ms=there_was,
            )
    return _is_late(answer, before.last_received_at)


def too_short(needed_ms: float, there_was_ms: float) -> bool:
    """Whether clips that last `needed_ms` cannot have been shown in the server's time that there was."""
    # A negative time: the server's own clock was set back, which is nobody's fault.
    return there_was_ms >= 0 and needed_ms * (1 - SLACK_SHARE) > there_was_ms + SLACK_MS


def _seen_before(connection: Connection, answer: Answer, issued_at: datetime, before_ms: float) -> bool:
    """True where the clip was seen by tickets from before a reload: only the answer came by the new ones."""
    viewed_at = repository.first_view(connection, answer.run, answer.trial_index, answer.play)
    if viewed_at is None or viewed_at >= issued_at:
        return False
    own, others = milliseconds(answer.received_at - viewed_at), milliseconds(answer.received_at - issued_at)
    return not too_short(answer.clip_ms, own) and not too_short(before_ms, others)


def _is_late(answer: Answer, last_received_at: datetime | None) -> bool:
    """True where it came sooner after the one before than its clip lasts, or long after it was given."""
    delay = answer.received_at - answer.answered_at if answer.answered_at else timedelta()
    gap_ms = milliseconds(answer.received_at - last_received_at) if last_received_at else answer.clip_ms
    return abs(delay) > LATE or gap_ms < answer.clip_ms


def milliseconds(time: timedelta) -> float:
    """A length of time as a number."""
    return time / _MILLISECOND


def _row(
    answer: Answer, batch: Batch, given: RatingEvidence, *, late: bool, digest_right: bool | None
) -> dict[str, Any]:
    return {
        "study_run_id": answer.run,
        "trial_index": answer.trial_index,
        "play": answer.play,
        "ticket": given.ticket,
        "issued_at": batch.issued_at,
        "received_at": answer.received_at,
        "clip_ms": answer.clip_ms,
        "digest": given.digest,
        "digest_right": digest_right,
        "late": late,
        "interaction": given.interaction.model_dump() if given.interaction else None,
    }
