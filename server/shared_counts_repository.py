"""Limits that hold for all processes of a server, on whatever host: counted in PostgreSQL.

Each process asks its own memory first, so that a flood costs the database no more than one process lets pass.
"""

import hashlib
import random
from collections.abc import Callable
from functools import cached_property
from typing import Any

from sqlalchemy import text

from server.db import Database

FORGOTTEN_S = 6 * 3600.0
"""After so long without an event a count goes: shares are full again by then, failures forgiven."""
KEYS_MAX = 20_000
"""Of more the oldest go: strangers can invent keys, such as links that do not exist."""
_SWEPT_ONE_IN, _SWEPT_AT_ONCE = 100, 1000
_REFILLED = (
    "least(:share, shared_counts.amount "
    "+ extract(epoch FROM clock_timestamp() - shared_counts.at) * :share / :window)"
)
_HIT = text(
    "INSERT INTO shared_counts (key, amount, before, at) "  # noqa: S608 - our words
    "VALUES (:key, :share - :number, :share, clock_timestamp()) "
    f"ON CONFLICT (key) DO UPDATE SET before = {_REFILLED}, at = clock_timestamp(), "
    f"amount = {_REFILLED} - CASE WHEN {_REFILLED} >= 1 THEN :number ELSE 0 END RETURNING before"
)
_FAILED = text(
    "INSERT INTO shared_counts (key, amount, before, at) VALUES (:key, 1, 0, clock_timestamp()) "
    "ON CONFLICT (key) DO UPDATE SET before = shared_counts.amount, at = clock_timestamp(), "
    "amount = 1 + CASE WHEN shared_counts.at < clock_timestamp() - make_interval(secs => :forgotten) "
    "THEN 0 ELSE shared_counts.amount END"
)
_FAILURES = text(
    "SELECT amount, extract(epoch FROM clock_timestamp() - at) FROM shared_counts WHERE key = :key"
)
_FORGET = text("DELETE FROM shared_counts WHERE key = :key")
_SWEEP_OLD = text(
    "DELETE FROM shared_counts WHERE key IN (SELECT key FROM shared_counts "
    "WHERE at < now() - make_interval(secs => :forgotten) ORDER BY at LIMIT :most FOR UPDATE SKIP LOCKED)"
)
_SWEEP_MANY = text(
    "DELETE FROM shared_counts WHERE key IN (SELECT key FROM shared_counts ORDER BY at "
    "LIMIT least(:most, greatest(0, (SELECT count(*) FROM shared_counts) - :kept)) FOR UPDATE SKIP LOCKED)"
)


class SharedCounts:
    """The counts of one server.

    Parameters
    ----------
    secret : callable
        Gives the installation's key: what is counted is stored as a keyed hash.
    """

    def __init__(self, database: Database, secret: Callable[[], bytes]) -> None:
        self._engine, self._secret = database.counting_engine, secret

    def hit(self, what: str, share: float, number: int, window_s: float) -> float:
        """Take `number` from a share, refilled within `window_s`; return what was left before."""
        values = {"key": self._hidden(what), "share": share, "number": number, "window": window_s}
        return float(self._run(_HIT, values))

    def failed(self, what: str) -> None:
        """Count one failure."""
        self._run(_FAILED, {"key": self._hidden(what), "forgotten": FORGOTTEN_S})

    def failures(self, what: str) -> tuple[int, float]:
        """How many failures there were, and how many seconds ago the last."""
        with self._engine.connect() as connection:
            row = connection.execute(_FAILURES, {"key": self._hidden(what)}).one_or_none()
        return (0, 0.0) if row is None else (int(row[0]), float(row[1]))

    def forget(self, what: str) -> None:
        """Forget the failures."""
        self._run(_FORGET, {"key": self._hidden(what)})

    def _run(self, statement: Any, values: dict[str, Any]) -> Any:
        with self._engine.begin() as connection:
            done = connection.execute(statement, values)
            given = done.scalar() if done.returns_rows else None
        if random.randrange(_SWEPT_ONE_IN) == 0:
            self.sweep()
        return given

    def sweep(self) -> None:
        """Remove counts that are forgotten, and the oldest of too many; some at a time."""
        # In a transaction of its own, past rows in use: nobody waits for it who counts, and it for nobody.
        with self._engine.begin() as connection:
            connection.execute(_SWEEP_OLD, {"forgotten": FORGOTTEN_S, "most": _SWEPT_AT_ONCE})
            connection.execute(_SWEEP_MANY, {"kept": KEYS_MAX, "most": _SWEPT_AT_ONCE})

    @cached_property
    def _key(self) -> bytes:
        return hashlib.blake2b(self._secret(), digest_size=32, person=b"palpebra limits").digest()

    def _hidden(self, what: str) -> str:
        return hashlib.blake2b(what.encode("utf-8", "replace"), key=self._key, digest_size=16).hexdigest()
