"""How often something may happen: in the memory of one process, and in PostgreSQL for all together."""

import threading
import time
from collections.abc import Callable

from server.errors import TooManyRequests
from server.shared_counts_repository import SharedCounts

WINDOW_S = 60.0
_MAX_KEYS = 10_000


class RateLimit:
    """At most `per_minute` events a key, refilled steadily (a token bucket).

    Parameters
    ----------
    name : str, optional
        Tells its keys from those of other limits where they are shared.
    shared : SharedCounts, optional
        Where the processes of a server count together; each by itself where not given.
    window_s : float, optional
        How long it takes until a share that was used up is whole again, where that is no minute.
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
                f"Too many requests; please try again in {wait} s.", headers={"retry-after": str(wait)}
            )


class BoundedRecords:
    """What is written down of a flood: so many events a minute, and of each kind; others are counted.

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
