"""How often something may happen, in one process or in all of a server, and how many streams are open."""

import hashlib
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

from sqlalchemy import text

from server.core.db import Database
from server.core.errors import TooManyRequests

# Limits that hold for all processes of a server, on whatever host: counted in PostgreSQL.
#
# Each process asks its own memory first, so that a flood costs the database no more than one process lets
# pass.

FORGOTTEN_S = 6 * 3600.0
"""After so long without an event a count goes: shares are full again by then, failures forgiven."""
KEYS_MAX = 20_000
"""Beyond this number the oldest are dropped: strangers can invent keys, such as links that do not exist."""
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
        # In a separate transaction that skips rows in use: it waits for nobody, and nobody who counts waits
        # for it.
        with self._engine.begin() as connection:
            connection.execute(_SWEEP_OLD, {"forgotten": FORGOTTEN_S, "most": _SWEPT_AT_ONCE})
            connection.execute(_SWEEP_MANY, {"kept": KEYS_MAX, "most": _SWEPT_AT_ONCE})

    @cached_property
    def _key(self) -> bytes:
        return hashlib.blake2b(self._secret(), digest_size=32, person=b"palpebra limits").digest()

    def _hidden(self, what: str) -> str:
        return hashlib.blake2b(what.encode("utf-8", "replace"), key=self._key, digest_size=16).hexdigest()


# How often something may happen: in the memory of one process, and in PostgreSQL for all together.

WINDOW_S = 60.0
_MAX_KEYS = 10_000


class RateLimit:
    """At most `per_minute` events per key, refilled steadily (a token bucket).

    Parameters
    ----------
    name : str, optional
        Distinguishes its keys from those of other limits in a shared table.
    shared : SharedCounts, optional
        Where the processes of a server count together; each by itself where not given.
    window_s : float, optional
        How long it takes until a share that was used up is whole again, if that is not a minute.
    """

    def __init__(
        self,
        per_minute: int,
        clock: Callable[[], float] = time.monotonic,
        name: str = "",
        shared: SharedCounts | None = None,
        window_s: float = WINDOW_S,
    ) -> None:
        self.per_minute, self._window_s = per_minute, window_s
        self._clock = clock
        self._name, self._shared = name, shared
        self._lock = threading.Lock()
        self._buckets: dict[str, tuple[float, float]] = {}

    def hit(self, key: str) -> None:
        """Count one event; TooManyRequests where `key` has used up its share."""
        self._take(key, 1)

    def check(self, key: str) -> None:
        """TooManyRequests where `key` has used up its share; counts nothing."""
        self._take(key, 0)

    def _take(self, key: str, number: int) -> None:
        with self._lock:
            moment = self._clock()
            left, seen = self._buckets.pop(key, (float(self.per_minute), moment))
            left = min(self.per_minute, left + (moment - seen) * self.per_minute / self._window_s)
            # Put back at the end: the dictionary's first key is then the one unused for longest.
            self._buckets[key] = (left - number if left >= 1 else left, moment)
            if len(self._buckets) > _MAX_KEYS:
                del self._buckets[next(iter(self._buckets))]
        if left >= 1 and self._shared is not None:
            left = self._shared.hit(f"{self._name}:{key}", self.per_minute, number, self._window_s)
        if left < 1:
            wait = max(1, round((1 - left) * self._window_s / self.per_minute))
            raise TooManyRequests(
                f"Too many requests. Please try again in {wait} s.", headers={"retry-after": str(wait)}
            )


class BoundedRecords:
    """A limited record of a flood: some events a minute, and of each kind; the others are counted.

    A flood must not fill the audit log, and with it the disk.
    """

    def __init__(self, per_minute: int, of_a_kind: int) -> None:
        self._all, self._kinds = RateLimit(per_minute), RateLimit(of_a_kind)
        self._lock, self._unwritten = threading.Lock(), 0

    def written(self, kind: str = "") -> int | None:
        """How many events were not written down since the last that was; None: do not write this one."""
        try:
            self._kinds.hit(kind)
            self._all.hit("")
        except TooManyRequests:
            with self._lock:
                self._unwritten += 1
            return None
        with self._lock:
            unwritten, self._unwritten = self._unwritten, 0
        return unwritten


# How many streams of the monitor are open in this worker, of each account and of all.

MAX_STREAMS = 20
"""Per account. Each looks at its study every two seconds: 300 made clips wait for a second."""


MAX_STREAMS_OVERALL = 100
"""For all accounts together: a laboratory may have many people, and raters come first."""


class OpenStreams:
    """Counted while they last; changed by the event loop alone."""

    def __init__(self, maximum: int = MAX_STREAMS, overall: int = MAX_STREAMS_OVERALL) -> None:
        self._maximum, self._overall = maximum, overall
        self._open: Counter[int] = Counter()

    def check(self, account: int) -> None:
        """Refuse one more stream where there are too many."""
        if self._open[account] >= self._maximum:
            raise TooManyRequests(
                f"At most {self._maximum} live monitors per account are allowed at a time. Close some of "
                f"them."
            )
        if self._open.total() >= self._overall:
            raise TooManyRequests(
                f"All {self._overall} live monitors of this server are in use. Try again when someone has "
                f"closed one."
            )

    @contextmanager
    def one(self, account: int) -> Iterator[bool]:
        """Count a stream as long as it is open; False where others, asked for at once, were before it."""
        has_room = self._open[account] < self._maximum and self._open.total() < self._overall
        self._open[account] += has_room
        try:
            yield has_room
        finally:
            self._open[account] -= has_room
            if not self._open[account]:
                del self._open[account]
