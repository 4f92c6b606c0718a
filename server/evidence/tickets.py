"""Tickets: leave to answer one play of one trial, signed by the server when it hands the run out.

A batch names its run and the moment it was issued, under a seal:  batch = run.t.nonce.seal,
seal = HMAC(k, "batch:" run.t.nonce), with t in milliseconds since 1970 and k the installation's key.
The ticket of trial i, play p is  HMAC(k, "ticket:" batch ":" i ":" p). Nothing of it is stored when it is
issued, and it is good offline. Both codes are cut to 128 bits.
"""

import binascii
import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache

from server.evidence.refusals import TicketExpired, TicketInvalid, TicketOfAnotherRun, TicketOfAnotherTrial

CODE_BYTES = 16
CODE_LETTERS = 22
"""In base64, the two that only fill it up left out."""
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
    parts = head.split(".")
    # Bytes, since text beyond ASCII cannot be compared in constant time.
    sealed = hmac.compare_digest(_code(key, f"batch:{head}").encode(), seal.encode())
    if len(parts) != 3 or not sealed:
        raise TicketInvalid("Expected a batch of tickets as this server issued it; nothing is stored.")
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
