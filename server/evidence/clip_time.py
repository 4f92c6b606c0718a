"""What a run's answers took of the time since their tickets were issued, kept with the run's counts."""

import math
from datetime import datetime
from typing import NamedTuple


class ClipTime(NamedTuple):
    """How long the clips of a run's answers last, and when the first and last of it was.

    Attributes
    ----------
    clip_ms : float
        Of all answers.
    newest_clip_ms : float
        Of those by tickets issued at `newest_issued_at`.
    first_issued_at, newest_issued_at : datetime or None
        When tickets of answers were issued; None where no answer brought one.
    last_received_at : datetime or None
        When the last answer came, by the server's clock.
    """

    clip_ms: float = 0.0
    newest_clip_ms: float = 0.0
    first_issued_at: datetime | None = None
    newest_issued_at: datetime | None = None
    last_received_at: datetime | None = None

    def plus(self, clip_ms: float, issued_at: datetime, received_at: datetime) -> "ClipTime":
        """With one more answer: the same in whatever order they come."""
        first, newest, last = self[2:]
        is_newer = newest is None or issued_at > newest
        before_ms = 0.0 if is_newer else self.newest_clip_ms
        return ClipTime(
            self.clip_ms + clip_ms,
            before_ms + clip_ms * (is_newer or issued_at == newest),
            issued_at if first is None else min(first, issued_at),
            issued_at if newest is None else max(newest, issued_at),
            received_at if last is None else max(last, received_at),
        )

    def same(self, other: "ClipTime") -> bool:
        """True where both say the same, but for what sums differ by the order of their terms."""
        sums = zip(self[:2], other[:2], strict=True)
        return self[2:] == other[2:] and all(math.isclose(one, two, abs_tol=1e-6) for one, two in sums)

    def since(self, issued_at: datetime) -> float | None:
        """Clip time in ms of answers by tickets issued from then on; None where these sums do not say."""
        if self.newest_issued_at is None or issued_at > self.newest_issued_at:
            return 0.0
        if issued_at == self.newest_issued_at:
            return self.newest_clip_ms
        is_first = self.first_issued_at is not None and issued_at <= self.first_issued_at
        return self.clip_ms if is_first else None
