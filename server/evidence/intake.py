"""What an answer must bring along to be stored: its ticket, time enough, and the digest of its clip."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property
from typing import Any

from sqlalchemy import Connection

from server.errors import ApiError
from server.evidence import repository
from server.evidence.clip_bytes import ClipBytes, clip_digest, older_digest
from server.evidence.refusals import (
    ClipsOutlastTickets,
    DigestDiffers,
    DigestMissing,
    TicketExpired,
    TicketMissing,
)
from server.evidence.repository import Spent
from server.evidence.schemas import RatingEvidence
from server.evidence.tickets import Batch, check_ticket, claimed_time, evidence_key
from server.rate_limit import RateLimit
from server.settings import Settings

SLACK_MS = 1_000.0
SLACK_SHARE = 0.02
"""How much longer the clips may last than the time there was: no screen keeps quite the server's time."""
LATE = timedelta(seconds=60)
FALSE_ANSWERS_PER_MINUTE = 60
ENFORCED_ORIGINS = ("participant", "pilot")


@dataclass(frozen=True)
class Answer:
    """One answer as it comes in.

    clips: hash and size of each clip of the trial, in order. clip_ms: how long the longest lasts, over all
    views, since clips may be shown side by side; 0 where nothing was rated.
    received_at: by the server's clock. answered_at: by the client's. spent: what the run's answers took since
    its ticket was issued (`issued_at`); None where there is no ticket.
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
    spent: Spent | None


def issued_at(evidence: RatingEvidence | None) -> datetime | None:
    """When the ticket of an answer says it was issued; None without one, or where it says no time."""
    return claimed_time(evidence.batch) if evidence else None


class Intake:
    """Checks what comes with answers, for one server.

    refuses: False where what breaks a rule is stored and judged instead.
    rehearses: True where simulated runs are treated as people's.
    """

    def __init__(self, settings: Settings, clips: ClipBytes, *, rehearses: bool = False) -> None:
        self._settings, self.clips, self.rehearses = settings, clips, rehearses
        self.refuses = settings.evidence == "refuse"
        self._false_answers = RateLimit(FALSE_ANSWERS_PER_MINUTE)

    @cached_property
    def key(self) -> bytes:
        """The key of the tickets; the secret key behind it is made at its first use, not before."""
        return evidence_key(self._settings.key)

    def take(self, connection: Connection, answer: Answer) -> None:
        """Store the evidence of an answer; refused by name where it cannot have been given so.

        Where nothing is refused, evidence that does not hold is left out: the answer then counts as without.
        """
        enforced = self.refuses and (answer.origin in ENFORCED_ORIGINS or self.rehearses)
        try:
            batch, given = self._batch(answer, answer.evidence)
            late = _in_time(connection, answer, batch)
            right = self._digest(answer, given)
        except ApiError as refusal:
            if enforced:
                # Each run has a share of its own: who sends false answers hinders nobody else.
                self._false_answers.hit(answer.run_id)
                # A page that stood open for months sends no false answer: noted, and no word on the run.
                event = repository.EXPIRED if isinstance(refusal, TicketExpired) else repository.REFUSED
                repository.note_refusal(connection, answer.run, event, refusal.code, answer.received_at)
                raise
            return
        repository.add(connection, _row(answer, batch, given, late=late, digest_right=right))

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


def _in_time(connection: Connection, answer: Answer, batch: Batch) -> bool:
    """Whether the answer came late; ClipsOutlastTickets where its clips cannot have been seen by then."""
    spent = answer.spent or Spent(0.0, 0.0, None, None)
    first = min(filter(None, (spent.first_issued_at, batch.issued_at)))
    for issued_at, before_ms in ((batch.issued_at, spent.batch_ms), (first, spent.run_ms)):
        needed, there_was = before_ms + answer.clip_ms, _ms(answer.received_at - issued_at)
        if _too_short(needed, there_was) and not _seen_before(connection, answer, issued_at, before_ms):
            raise ClipsOutlastTickets(
                f"Clips of {needed / 1000:.1f} s cannot have been watched in the {there_was / 1000:.1f} s "
                "since their tickets were issued; nothing is stored.",
                needed_ms=needed,
                there_was_ms=there_was,
            )
    return _is_late(answer, spent.last_received_at)


def _too_short(needed_ms: float, there_was_ms: float) -> bool:
    # A negative time: the server's own clock was set back, which is nobody's fault.
    return there_was_ms >= 0 and needed_ms * (1 - SLACK_SHARE) > there_was_ms + SLACK_MS


def _seen_before(connection: Connection, answer: Answer, issued_at: datetime, before_ms: float) -> bool:
    """True where the clip was seen by tickets from before a reload: only the answer came by the new ones."""
    viewed_at = repository.first_view(connection, answer.run, answer.trial_index, answer.play)
    if viewed_at is None or viewed_at >= issued_at:
        return False
    own, others = _ms(answer.received_at - viewed_at), _ms(answer.received_at - issued_at)
    return not _too_short(answer.clip_ms, own) and not _too_short(before_ms, others)


def _is_late(answer: Answer, last_received_at: datetime | None) -> bool:
    """True where it came sooner after the one before than its clip lasts, or long after it was given."""
    delay = answer.received_at - answer.answered_at if answer.answered_at else timedelta()
    gap_ms = _ms(answer.received_at - last_received_at) if last_received_at else answer.clip_ms
    return abs(delay) > LATE or gap_ms < answer.clip_ms


def _ms(time: timedelta) -> float:
    return time / timedelta(milliseconds=1)


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
