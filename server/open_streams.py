"""How many streams of the monitor are open in this worker, of each account and of all."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from server.errors import TooManyRequests

MAX_STREAMS = 20
"""Of one account. Each looks at its study every two seconds: 300 made clips wait for a second."""


MAX_STREAMS_OVERALL = 100
"""Of all accounts together: a laboratory's own people may be many, and raters come first."""


class OpenStreams:
    """Counted while they last; changed by the event loop alone."""

    def __init__(self, maximum: int = MAX_STREAMS, overall: int = MAX_STREAMS_OVERALL) -> None:
        self._maximum, self._overall = maximum, overall
        self._open: Counter[int] = Counter()

    def check(self, account: int) -> None:
        """Refuse one more stream where there are too many."""
        if self._open[account] >= self._maximum:
            raise TooManyRequests(
                f"At most {self._maximum} monitors of one account are kept up to date at a time; close some."
            )
        if self._open.total() >= self._overall:
            raise TooManyRequests(
                f"At most {self._overall} monitors are kept up to date at a time, and all are taken; "
                "try again once somebody has closed one."
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
