"""Passwords: argon2 hashes, and what a new one must be."""

from functools import cache

from pwdlib import PasswordHash

from server.errors import Invalid

SHORTEST, LONGEST = 10, 200


class WeakPassword(Invalid):
    """A new password is too easy to guess."""

    code = "weak_password"


@cache
def _hasher() -> PasswordHash:
    return PasswordHash.recommended()


@cache
def _nobody() -> str:
    return _hasher().hash("the password of an account that does not exist")


def hash_password(password: str, name: str) -> str:
    """Return the argon2 hash of a new password; WeakPassword where it is too short or is the name."""
    if not SHORTEST <= len(password) <= LONGEST:
        raise WeakPassword(f"Expected a password of {SHORTEST} to {LONGEST} characters, got {len(password)}.")
    if password.casefold() == name.casefold() or len(set(password)) < 4:
        raise WeakPassword(
            "That password is too easy to guess; choose one that is not your name or one letter."
        )
    return _hasher().hash(password)


def password_fits(password: str, stored: str | None) -> bool:
    """True where `password` has the hash `stored`; takes as long where there is no account."""
    fits = _hasher().verify(password, stored or _nobody())
    return fits and stored is not None
