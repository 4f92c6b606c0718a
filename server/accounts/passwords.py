"""Passwords: argon2 hashes made by one patient thread, and what a new one must be."""

import asyncio
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

from pwdlib import PasswordHash
from zxcvbn import zxcvbn

from server.errors import ApiError, Invalid

T = TypeVar("T")
SHORTEST, LONGEST = 12, 200
LEAST_SCORE = 3
"""Of zxcvbn's 0 to 4: at least 10^8 guesses by somebody who knows people's habits."""
JUDGED = 72
"""zxcvbn looks at no more characters."""
WAITING = 16
"""Passwords that may wait for their turn: some two seconds' work."""
NICENESS = 10


class WeakPassword(Invalid):
    """A new password is too easy to guess."""

    code = "weak_password"


class PasswordsBusy(ApiError):
    """More passwords are waiting than can be looked at soon."""

    status = 503
    code = "busy"


@cache
def _hasher() -> PasswordHash:
    return PasswordHash.recommended()


@cache
def _nobody() -> str:
    return _hasher().hash("the password of an account that does not exist")


def check_strength(password: str, name: str) -> None:
    """WeakPassword where a new password is short, common, or made of the name and its like."""
    if not SHORTEST <= len(password) <= LONGEST:
        raise WeakPassword(f"Expected a password of {SHORTEST} to {LONGEST} characters, got {len(password)}.")
    if name.casefold() in password.casefold() and len(password) - len(name) < SHORTEST:
        raise WeakPassword("That password is too easy to guess: it is little more than your name.")
    judged = zxcvbn(password[:JUDGED], user_inputs=[name, *name.split(), "palpebra"], max_length=JUDGED)
    if judged["score"] < LEAST_SCORE:
        said = judged["feedback"]["warning"] or "a few uncommon words in a row are easy to keep in mind"
        raise WeakPassword(f"That password is too easy to guess: {said.rstrip('.')}.")


def hash_password(password: str, name: str) -> str:
    """Return the argon2 hash of a new password; WeakPassword where it is too easy to guess."""
    check_strength(password, name)
    return _hasher().hash(password)


@dataclass(frozen=True)
class Checked:
    """The hash that a password fits.

    Attributes
    ----------
    stored : str or None
        As it was read; None where the password fits none.
    renewed : str or None
        A hash of the same password by today's parameters, where the stored one has others.
    """

    stored: str | None
    renewed: str | None = None


def checked_password(password: str, stored: str | None) -> Checked:
    """Compare a password with the hash `stored`; takes as long where there is none."""
    fits, renewed = _hasher().verify_and_update(password, stored or _nobody())
    return Checked(stored, renewed) if fits and stored else Checked(None)


def password_fits(password: str, stored: str) -> bool:
    """True where `password` has the hash `stored`."""
    return _hasher().verify(password, stored)


class PasswordWork:
    """The one thread of a process that hashes: each hash takes 64 MB and four cores for a tenth of a second.

    It runs at a lower priority than the threads that serve raters, and only so many wait for it.
    """

    def __init__(self, waiting: int = WAITING) -> None:
        self._pool = ThreadPoolExecutor(1, "passwords", initializer=_step_back)
        self._places = threading.BoundedSemaphore(waiting)

    async def run(self, work: Callable[[], T]) -> T:
        """Do `work` in its turn; PasswordsBusy where too many wait. The event loop goes on meanwhile."""
        if not self._places.acquire(blocking=False):
            raise PasswordsBusy(
                "Too many people are signing in at this moment; please try again in 5 s.",
                headers={"retry-after": "5"},
            )
        try:
            # Shielded: a client that goes away frees its place only when its turn is over.
            future = asyncio.get_running_loop().run_in_executor(self._pool, work)
        except BaseException:
            self._places.release()
            raise
        future.add_done_callback(lambda _done: self._places.release())
        return await asyncio.shield(future)

    def close(self) -> None:
        """End the thread."""
        self._pool.shutdown(cancel_futures=True)


def _step_back() -> None:
    # On Linux each thread has a niceness of its own, which the threads it starts (argon2's lanes) inherit.
    if hasattr(os, "nice") and os.uname().sysname == "Linux":
        os.nice(NICENESS)
    _hasher(), _nobody()
