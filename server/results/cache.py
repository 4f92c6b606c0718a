"""Results that were counted, in the memory of one worker: nothing is counted again while nothing changed.

A page asks every quarter of a minute, and a million ratings take seconds to count. What is small is counted
at once. Where counting is slow the page gets what was counted last, with its time, while a thread counts
again, now and then. A change of what counts (exclusion, erasure, version) is never answered with older ones.
"""

import hashlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from server.results.schemas import AnyResults

SLOW_S = 0.5
"""Counting that takes longer goes on behind the page's back."""
PAUSE = 10.0
"""So many times as long as it took until slow counting begins again: at most a tenth of one core."""
MAX_KEPT = 64
log = logging.getLogger("palpebra")


class Revision(NamedTuple):
    """What results depend on: equal revisions give equal results."""

    decisions: tuple[Any, ...]
    """Version, exclusions and erasures."""
    ratings: tuple[Any, ...]


@dataclass(frozen=True)
class CachedResult:
    """Results and what they were counted from."""

    revision: Revision
    results: AnyResults
    seconds: float
    at: float

    @property
    def etag(self) -> str:
        """Equal for equal results."""
        return f'"{hashlib.sha256(repr(self.revision).encode()).hexdigest()[:32]}"'


Key = tuple[int, str, int, str]
"""Study, origin, data series and scale."""
Count = Callable[[], tuple[Revision, AnyResults]]


# Decision 0311: Results are kept until something changes.
class ResultsCache:
    """The results of some studies, shared by the threads of a worker."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._kept: dict[Key, CachedResult] = {}
        self._counting: dict[Key, threading.Lock] = {}

    def get(self, key: Key, revision: Revision, count: Count) -> CachedResult:
        """Results of `revision`, or the latest of the same decisions where counting is slow."""
        kept = self._kept.get(key)
        if kept is None or kept.revision.decisions != revision.decisions:
            return self._count_once(key, revision, count)
        if kept.revision == revision:
            return kept
        if kept.seconds <= SLOW_S:
            return self._count_once(key, revision, count)
        if self._clock() - kept.at > PAUSE * kept.seconds and not self._of(key).locked():
            threading.Thread(target=self._count_quietly, args=(key, revision, count), daemon=True).start()
        return kept

    def _count_once(self, key: Key, revision: Revision, count: Count) -> CachedResult:
        """Count, or take what another thread counted meanwhile."""
        with self._of(key):
            kept = self._kept.get(key)
            return kept if kept is not None and kept.revision == revision else self._counted(key, count)

    def _count_quietly(self, key: Key, revision: Revision, count: Count) -> None:
        try:
            self._count_once(key, revision, count)
        except Exception as error:  # nobody waits for it; the next request gets the error
            log.error("results could not be counted: %s", type(error).__name__)
            with self._lock:
                self._kept.pop(key, None)

    def _counted(self, key: Key, count: Count) -> CachedResult:
        begun = self._clock()
        revision, results = count()
        made = CachedResult(revision, results, self._clock() - begun, self._clock())
        with self._lock:
            self._kept.pop(key, None)
            self._kept[key] = made
            while len(self._kept) > MAX_KEPT:
                del self._kept[next(iter(self._kept))]
        return made

    def _of(self, key: Key) -> threading.Lock:
        with self._lock:
            return self._counting.setdefault(key, threading.Lock())
