"""A limit on how often something may happen, kept in the memory of one worker and nowhere else."""

import threading
import time
from collections.abc import Callable

from server.errors import TooManyRequests

WINDOW_S = 60.0
_MAX_KEYS = 10_000


class RateLimit:
    """At most `per_minute` events a key, refilled steadily (a token bucket)."""

    def __init__(self, per_minute: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.per_minute = per_minute
        self._clock = clock
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
            left = min(self.per_minute, left + (moment - seen) * self.per_minute / WINDOW_S)
            # Put back at the end: the dictionary's first key is then the one unused for longest.
            self._buckets[key] = (left - number if left >= 1 else left, moment)
            if len(self._buckets) > _MAX_KEYS:
                del self._buckets[next(iter(self._buckets))]
        if left < 1:
            wait = max(1, round((1 - left) * WINDOW_S / self.per_minute))
            raise TooManyRequests(
                f"Too many requests; please try again in {wait} s.", headers={"retry-after": str(wait)}
            )
