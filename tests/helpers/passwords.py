"""Hashes of passwords that cost no time: signing in is what most tests do first."""

import pytest
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from server.accounts import credentials

QUICK = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
NOBODY = QUICK.hash("the password of an account that does not exist")


@pytest.fixture(autouse=True)
def quick_hashes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Real argon2 hashes in this process, of the least cost; folders that measure the cost have their own."""
    monkeypatch.setattr(credentials, "_hasher", lambda: QUICK)
    monkeypatch.setattr(credentials, "_nobody", lambda: NOBODY)
