"""What an answer must bring along to be stored: its ticket, time enough, and the digest of its clip."""

import binascii
import hmac
import secrets
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property, lru_cache
from typing import Any, Protocol

from sqlalchemy import Connection

from server.core.errors import ApiError
from server.core.limits import RateLimit
from server.core.settings import Settings
from server.participation import evidence_repository
from server.participation.answer_schemas import RatingEvidence
from server.participation.clip_hashes import ClipHashes, clip_digest
from server.participation.refusals import (
    ClipsOutlastTickets,
    DigestDiffers,
    DigestMissing,
    TicketExpired,
    TicketInvalid,
    TicketMissing,
    TicketOfAnotherRun,
    TicketOfAnotherTrial,
    UnratedWithoutDigest,
)
from server.participation.tallies import ClipTime

# A ticket is permission to answer one play of one trial, signed by the server when it sends the run.
#
# A batch names its run and the moment it was issued, under a seal:  batch = run.t.nonce.seal,
# seal = HMAC(k, "batch:" run.t.nonce), with t in milliseconds since 1970 and k the installation's key.
# The ticket of trial i, play p is  HMAC(k, "ticket:" batch ":" i ":" p). Nothing is stored when a ticket is
# issued, and it is valid offline. Both codes are cut to 128 bits.

# Half of SHA-256 is far out of reach of FALSE_ANSWERS_PER_MINUTE guesses, and every state carries a ticket
# per play: 22 letters in place of 43.
CODE_BYTES = 16
CODE_LETTERS = 22
"""In base64, the two that only fill it up left out."""
# Two batches of one run in the same millisecond must differ, or they would hold the same tickets.
NONCE_BYTES = 6
LIFETIME = timedelta(days=60)
"""From the ticket to its answer: longer than a visit may last anywhere. Delivery may be later still."""
MAX_OPENED = 4096
"""Batches kept open: the answers of a visit come by the same one, whose seal is looked at once."""
_URL_SAFE = bytes.maketrans(b"+/", b"-_")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Batch:
    """A batch of tickets: the run it is for, and when the server issued it."""

    text: str
    run: str
    issued_at: datetime


def evidence_key(secret: bytes) -> bytes:
    """The key of all tickets of an installation, from its secret key."""
    # A label per purpose: the key of the tickets gives away no other key made from the same secret.
    return hmac.digest(secret, b"palpebra evidence 1", "sha256")


def issue(key: bytes, run: str, moment: datetime) -> Batch:
    """A new batch for the run with this public id."""
    head = f"{run}.{(moment - _EPOCH) // timedelta(milliseconds=1)}.{secrets.token_hex(NONCE_BYTES)}"
    return open_batch(key, f"{head}.{_code(key, f'batch:{head}')}")


def tickets(key: bytes, batch: Batch, plays: Sequence[int]) -> list[list[str]]:
    """The tickets of every trial, in order: one for each of its plays, whose number `plays` gives."""
    head = f"ticket:{batch.text}:"
    return [
        [_code(key, f"{head}{trial}:{play}") for play in range(1, count + 1)]
        for trial, count in enumerate(plays)
    ]


def ticket(key: bytes, batch: Batch, trial_index: int, play: int) -> str:
    """The ticket of one play of one trial; also the nonce under which its clip is digested."""
    return _code(key, f"ticket:{batch.text}:{trial_index}:{play}")


@lru_cache(maxsize=MAX_OPENED)
def open_batch(key: bytes, text: str) -> Batch:
    """The batch of this text; TicketInvalid where the seal does not fit."""
    head, _, seal = text.rpartition(".")
    # The seal comes last, so that the run and the moment are covered whatever they hold.
    parts = head.split(".")
    # Bytes, since text beyond ASCII cannot be compared in constant time.
    sealed = hmac.compare_digest(_code(key, f"batch:{head}").encode(), seal.encode())
    if len(parts) != 3 or not sealed:
        raise TicketInvalid("Expected a batch of tickets as this server issued it; nothing is stored.")
    # Read only now: under a seal of ours the second part is always a number.
    return Batch(text, parts[0], _EPOCH + timedelta(milliseconds=int(parts[1])))


def check_ticket(
    key: bytes, batch: str, code: str, run: str, trial_index: int, play: int, given_at: datetime
) -> Batch:
    """The batch of a ticket that is good for this play of this run; refused by name where it is not.

    Parameters
    ----------
    given_at : datetime
        When the answer was given, which may be long before it is delivered.
    """
    # From the coarsest cause to the finest, so that a page with two visits open hears of the visit and not
    # of a trial.
    opened = open_batch(key, batch)
    if opened.run != run:
        raise TicketOfAnotherRun("Expected a ticket of this visit, got one of another; nothing is stored.")
    if given_at - opened.issued_at > LIFETIME:
        raise TicketExpired(f"Expected a ticket issued within {LIFETIME.days} days, got an older one.")
    if not hmac.compare_digest(ticket(key, opened, trial_index, play).encode(), code.encode()):
        raise TicketOfAnotherTrial(
            f"Expected the ticket of trial {trial_index}, play {play}, got another; nothing is stored."
        )
    return opened


def _code(key: bytes, message: str) -> str:
    digest = hmac.digest(key, message.encode(), "sha256")
    letters = binascii.b2a_base64(digest[:CODE_BYTES], newline=False)[:CODE_LETTERS]
    return letters.translate(_URL_SAFE).decode("ascii")


# What an answer must bring along to be stored: its ticket, time enough, and the digest of its clip.

SLACK_MS = 1_000.0
SLACK_SHARE = 0.02
"""How much longer the clips may last than the time there was: no screen keeps quite the server's time."""
TRIED_MS = 1_000.0
"""What a play without a rating takes at least: the page says that a clip cannot be shown for as long."""
UNFETCHED, UNFETCHED_SHARE = 3, 5
"""Plays of a run without a rating and without the clip's digest: at most three, or one for five trials."""
# Four times the outbox's longest pause (15 s): an answer delivered later than this was waiting for a
# connection, not for its turn.
LATE = timedelta(seconds=60)
_MILLISECOND = timedelta(milliseconds=1)
# More than a faulty page sends by itself, whose pauses grow, and too few to try out tickets or digests.
FALSE_ANSWERS_PER_MINUTE = 60
# Previews and simulated runs come from programs of ours, which have nothing to prove; a rehearsal says that
# it wants to.
ENFORCED_ORIGINS = ("participant", "pilot")


class TicketedSubmission(Protocol):
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
        How long they last, at once or in turn with what is between, over all views; where nothing was rated
        the time that trying to show them takes.
    trials : int
        Of the run.
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
    trials: int
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

    def __init__(self, settings: Settings, clips: ClipHashes, *, rehearses: bool = False) -> None:
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
        """Check and store the evidence of an answer; refuse an answer that cannot have been given like this.

        Returns `before` with this answer's clip time added. With `stores=False` the answer is only checked,
        because it is kept as a refused record.

        If the rules are not enforced for this run's origin, evidence that fails is dropped: the answer counts
        as one without evidence, and adds no clip time.
        """
        enforced = self.enforces(answer.origin)
        try:
            batch, given = self._batch(answer, answer.evidence)
            late = _in_time(connection, answer, batch, before)
            right = self._digest(connection, answer, given)
        except ApiError as refusal:
            if enforced:
                self.note(connection, answer, refusal, evidence_repository.ANSWER)
                raise
            # What is left out as evidence takes no time either: else a false answer would use up the time
            # of the true ones.
            return before
        if not stores:
            return before.plus(answer.clip_ms, batch.issued_at, answer.received_at)
        evidence_repository.add_evidence(
            connection, _row(answer, batch, given, late=late, digest_right=right)
        )
        # Wakes the task that judges such answers once the store gives the clip (`digests_judged_later`).
        if right is None and given.digest is not None:
            self.unchecked.set()
        return before.plus(answer.clip_ms, batch.issued_at, answer.received_at)

    def enforces(self, origin: str) -> bool:
        """Whether what breaks a rule is refused in runs of this origin."""
        return self.refuses and (origin in ENFORCED_ORIGINS or self.rehearses)

    def note(
        self,
        connection: Connection,
        sent: "TicketedSubmission",
        refusal: ApiError,
        what: evidence_repository.RefusalEvents,
    ) -> None:
        """Note once a run that something of it was refused for this reason, and limit how often it may be."""
        # Each run has its own share: a sender of false answers hinders nobody else.
        self._false_answers.hit(sent.run_id)
        # A page that stood open for months, or that was loaded again before its clip was there, sends nothing
        # false: noted, and no word on the run.
        harmless = isinstance(refusal, TicketExpired | UnratedWithoutDigest)
        event = what.expired if harmless else what.refused
        evidence_repository.note_refusal(connection, sent.run, event, refusal.code, sent.received_at)

    def _batch(self, answer: Answer, given: RatingEvidence | None) -> tuple[Batch, RatingEvidence]:
        if given is None:
            raise TicketMissing("Expected a ticket with the answer, got none; please reload the page.")
        where = (answer.run_id, answer.trial_index, answer.play)
        # By the client's word, which only identifies a late delivery: so old a ticket leaves time for any
        # clip.
        given_at = min(answer.received_at, answer.answered_at or answer.received_at)
        return check_ticket(self.key, given.batch, given.ticket, *where, given_at), given

    def _digest(self, connection: Connection, answer: Answer, given: RatingEvidence) -> bool | None:
        """True where the digest is right; None where none is needed, or the clip is not at hand."""
        if not answer.clips:
            return None
        if not answer.rated:
            return self._digest_of_unrated(connection, answer, given)
        if given.digest is None:
            raise DigestMissing("Expected a digest of the clip with its rating, got none; nothing is stored.")
        return self._is_right(answer, given)

    def _digest_of_unrated(
        self, connection: Connection, answer: Answer, given: RatingEvidence
    ) -> bool | None:
        """The same of a play that has no rating: a page that fetched its clip shows that it did.

        A few may be without, since networks fail, and those of clips that this server does not have either.
        """
        if given.digest is not None:
            return self._is_right(answer, given)
        allowed = max(UNFETCHED, answer.trials // UNFETCHED_SHARE)
        if evidence_repository.answers_without_digest(connection, answer.run) < allowed:
            return None
        if any(self.clips.hash_at_once(sha256, size) is None for sha256, size in answer.clips):
            return None
        raise UnratedWithoutDigest(
            f"Expected the digest of the clip: more than {allowed} plays without a rating have none; nothing "
            "is stored."
        )

    def _is_right(self, answer: Answer, given: RatingEvidence) -> bool | None:
        """Whether the digest is that of the clips; None where they are not at hand yet."""
        hashes = [self.clips.hash_at_once(sha256, size) for sha256, size in answer.clips]
        at_hand = [one for one in hashes if one is not None]
        if len(at_hand) < len(hashes):
            return None
        if clip_digest(given.ticket, *at_hand) != given.digest:
            raise DigestDiffers("Expected the digest of this trial's clip, got another; nothing is stored.")
        return True


def _in_time(connection: Connection, answer: Answer, batch: Batch, before: ClipTime) -> bool:
    """Whether the answer came late; ClipsOutlastTickets where its clips cannot have been seen by then."""
    first = min(filter(None, (before.first_issued_at, batch.issued_at)))
    of_batch = before.since(batch.issued_at)
    if of_batch is None:  # tickets of a page before a reload, after answers by those of a page after it
        of_batch = evidence_repository.clip_ms_since(connection, answer.run, batch.issued_at)
    # Counted twice (decision 0420). From this batch on: time spent idle before a reload does not count for
    # what is shown after it. From the first batch on: several batches at once do not multiply the time
    # there was.
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
    viewed_at = evidence_repository.first_view(connection, answer.run, answer.trial_index, answer.play)
    if viewed_at is None or viewed_at >= issued_at:
        return False
    own, others = milliseconds(answer.received_at - viewed_at), milliseconds(answer.received_at - issued_at)
    return not too_short(answer.clip_ms, own) and not too_short(before_ms, others)


def _is_late(answer: Answer, last_received_at: datetime | None) -> bool:
    """True where it came sooner after the one before than its clip lasts, or long after it was given."""
    delay = answer.received_at - answer.answered_at if answer.answered_at else timedelta()
    # Before the first answer nothing came: its gap counts as long enough.
    gap_ms = milliseconds(answer.received_at - last_received_at) if last_received_at else answer.clip_ms
    # Either sign: a client's clock that is ahead by a minute says as little about the delivery as one that
    # is behind.
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
