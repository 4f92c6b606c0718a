"""Passwords and the second factor: how they are kept and checked."""

import asyncio
import base64
import hashlib
import hmac
import io
import os
import secrets
import textwrap
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import pyotp
import segno
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.keywrap import (
    InvalidUnwrap,
    aes_key_unwrap_with_padding,
    aes_key_wrap_with_padding,
)
from pwdlib import PasswordHash
from zxcvbn import zxcvbn

from server.core.errors import ApiError, Invalid
from server.core.values import hash_token

# Passwords: argon2 hashes made by one patient thread, and what a new one must be.

T = TypeVar("T")
SHORTEST, LONGEST = 12, 200
LEAST_SCORE = 3
"""zxcvbn's score, 0 to 4: at least 10^8 guesses by somebody who knows people's habits."""
JUDGED = 72
"""zxcvbn looks at no more characters."""
WAITING = 16
"""Passwords that may wait for their turn: some two seconds' work."""
NICENESS = 10


class WeakPassword(Invalid, code="weak_password"):
    """A new password is too easy to guess."""


class PasswordsBusy(ApiError, status=503, code="busy"):
    """More passwords are waiting than can be looked at soon."""


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
        raise WeakPassword("This password is too easy to guess, because it resembles your name.")
    judged = zxcvbn(password[:JUDGED], user_inputs=[name, *name.split(), "palpebra"], max_length=JUDGED)
    if judged["score"] < LEAST_SCORE:
        said = judged["feedback"]["warning"] or (
            "use a few uncommon words in a row, which are easy to remember"
        )
        raise WeakPassword(f"This password is too easy to guess: {said[:1].lower()}{said[1:].rstrip('.')}.")


def hash_password(password: str, name: str) -> str:
    """Return the argon2 hash of a new password; WeakPassword where it is too easy to guess."""
    check_strength(password, name)
    return _hasher().hash(password)


@dataclass(frozen=True)
class PasswordCheck:
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


def checked_password(password: str, stored: str | None) -> PasswordCheck:
    """Compare a password with the hash `stored`; takes as long where there is none."""
    fits, renewed = _hasher().verify_and_update(password, stored or _nobody())
    return PasswordCheck(stored, renewed) if fits and stored else PasswordCheck(None)


def password_fits(password: str, stored: str) -> bool:
    """True where `password` has the hash `stored`."""
    return _hasher().verify(password, stored)


class PasswordWork:
    """The one thread of a process that hashes: each hash takes 64 MB and four cores for a tenth of a second.

    It runs at a lower priority than the threads that serve raters, and few requests may wait for it.
    """

    def __init__(self, waiting: int = WAITING) -> None:
        self._pool = ThreadPoolExecutor(1, "passwords", initializer=_step_back)
        self._places = threading.BoundedSemaphore(waiting)

    async def run(self, work: Callable[[], T]) -> T:
        """Do `work` in its turn; PasswordsBusy where too many wait. The event loop goes on meanwhile."""
        if not self._places.acquire(blocking=False):
            raise PasswordsBusy(
                "Too many people are signing in right now. Please try again in 5 s.",
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
    # On Linux each thread has its own niceness, which the threads it starts (argon2's lanes) inherit.
    if hasattr(os, "nice") and os.uname().sysname == "Linux":
        os.nice(NICENESS)
    _hasher(), _nobody()


# The second factor: time-based one-time codes (RFC 6238) and recovery codes.
#
# The database keeps a random number; the secret itself is derived from it with the server's key, so that a
# copy of the database alone lets nobody sign in. Once the server's key was changed, it keeps the secret
# itself, wrapped under the new key (AES key wrap with padding, RFC 5649, under HKDF-SHA-256), so that
# phones go on.

RECOVERY_CODES = 10
STEP_S = 30
CODE_BYTES = 15
"""Length of a recovery code: 120 bits, which nobody guesses offline either (ASVS 2.6.2 requires 112)."""
WRAPPED, WRAPPING = "wrapped:", b"palpebra second factors"


def new_seed() -> str:
    """A random seed to keep with the account."""
    return secrets.token_hex(16)


def secret_of(key: bytes, kept: str) -> str:
    """The base32 secret an authenticator app holds, from the server's key and what is kept of the account.

    Under another key it is another secret, which fits no code.
    """
    held = _unwrap_secret(key, kept) if kept.startswith(WRAPPED) else None
    if held is None:
        held = hmac.new(key, f"totp:{kept}".encode(), hashlib.sha256).digest()[:20]
    return base64.b32encode(held).decode("ascii")


def rewrap_secret(old_key: bytes, key: bytes, kept: str) -> str:
    """What to keep of an account under another key of the server, so that its app's secret stays.

    What is wrapped already, but not under `old_key`, is given back as it is.
    """
    if kept.startswith(WRAPPED) and _unwrap_secret(old_key, kept) is None:
        return kept
    secret = base64.b32decode(secret_of(old_key, kept))
    return WRAPPED + base64.b64encode(aes_key_wrap_with_padding(_wrapping_key(key), secret)).decode("ascii")


def _unwrap_secret(key: bytes, kept: str) -> bytes | None:
    try:
        return aes_key_unwrap_with_padding(_wrapping_key(key), base64.b64decode(kept.removeprefix(WRAPPED)))
    except InvalidUnwrap:
        return None


def _wrapping_key(key: bytes) -> bytes:
    return HKDF(algorithm=SHA256(), length=32, salt=None, info=WRAPPING).derive(key)


def provisioning_uri(secret: str, name: str) -> str:
    """The otpauth:// address that authenticator apps read."""
    return pyotp.TOTP(secret).provisioning_uri(name=name, issuer_name="Palpebra")


def qr_svg(text: str) -> str:
    """`text` as a QR code, an SVG document."""
    stream = io.BytesIO()
    segno.make(text, error="m").save(stream, kind="svg", scale=4, border=2)
    return stream.getvalue().decode("utf-8")


def accepted_step(secret: str, code: str, last_step: int | None) -> int | None:
    """The time step `code` belongs to, one step early or late allowed; None where wrong or used before."""
    current = int(time.time()) // STEP_S
    totp = pyotp.TOTP(secret)
    for step in (current, current - 1, current + 1):
        if hmac.compare_digest(totp.at(step * STEP_S), code) and (last_step is None or step > last_step):
            return step
    return None


def new_recovery_codes() -> list[str]:
    """Ten codes for the day the phone is lost, six groups of four characters; each works once."""
    drawn = (base64.b32encode(secrets.token_bytes(CODE_BYTES)).decode("ascii") for _ in range(RECOVERY_CODES))
    return ["-".join(textwrap.wrap(code.lower(), 4)) for code in drawn]


def is_recovery_code(code: str) -> bool:
    """Whether a code has the form of those of the day the phone is lost, not that of an app's."""
    return "-" in code.strip()


def hash_recovery_code(code: str) -> str:
    """What the database keeps of a recovery code."""
    return hash_token(code.strip().casefold())
