"""How many streams of the monitor each account has open, in this worker."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from server.errors import TooManyRequests

MAX_STREAMS = 20
"""Of one account. Each looks at its study every two seconds: 300 made clips wait for a second."""


class OpenStreams:
    """Counted while they last; changed by the event loop alone."""

    def __init__(self, maximum: int = MAX_STREAMS) -> None:
        self._maximum = maximum
        self._open: Counter[int] = Counter()

    def check(self, account: int) -> None:
        """Refuse one more stream where there are too many."""
        if self._open[account] >= self._maximum:
            raise TooManyRequests(
                f"At most {self._maximum} monitors of one account are kept up to date at a time; close some."
            )

    @contextmanager
    def one(self, account: int) -> Iterator[bool]:
        """Count a stream as long as it is open; False where others, asked for at once, were before it."""
        has_room = self._open[account] < self._maximum
        self._open[account] += has_room
        try:
            yield has_room
        finally:
            self._open[account] -= has_room
            if not self._open[account]:
                del self._open[account]
