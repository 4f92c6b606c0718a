"""One play's record against what was on the frame buffer. Times are ms on the computer's monotonic clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from screen_bench import bars

REFRESH_MS = 1000 / 60
POLL_MS = 1.0
"""How far two onsets read by the poller may differ where the truth does not."""

Change = tuple[float, int, int]


@dataclass(frozen=True)
class Sight:
    """A clip on the frame buffer: each frame's onset in the order of showing, whole picture in place."""

    onsets: tuple[tuple[int, float], ...]
    ended_ms: float
    torn: int


@dataclass(frozen=True)
class Record:
    """What the page stored of a play: each drawn frame and its time since the start key."""

    drawn: tuple[tuple[int, float], ...]
    frames: int
    fps: float
    verdict: str
    rule: str
    key_to_first_frame_ms: float | None
    clock_gap_ms: float | None = None
    clock_late_ms: float | None = None


@dataclass(frozen=True)
class Play:
    """A play seen from both sides.

    Attributes
    ----------
    missing : int
        Frames never on the screen.
    worst_off_ms, worst_late_ms : float
        How far an onset was from its recorded time, and from the clip's own schedule; both after taking away
        the play's median, which is the delay of the way to the screen.
    blind_ms : float
        The poller's longest hold-up meanwhile.
    """

    record: Record
    pressed_ms: float
    sight: Sight
    missing: int
    worst_off_ms: float
    worst_late_ms: float
    key_to_pixel_ms: float
    lag_ms: float
    blind_ms: float

    @property
    def is_measured(self) -> bool:
        """False if the poller itself was delayed for too long to know."""
        return self.blind_ms <= REFRESH_MS / 2

    @property
    def is_off(self) -> bool:
        """True if the record does not show what was on the screen."""
        return self.missing > 0 or self.worst_off_ms > REFRESH_MS + POLL_MS

    @property
    def is_right(self) -> bool:
        """True where each frame was on the screen within one refresh of its time."""
        return self.missing == 0 and self.worst_late_ms <= REFRESH_MS + POLL_MS


def sights(changes: Sequence[Change]) -> list[Sight]:
    """Cut the poller's log into clips: from the first bars after the surround to the surround again."""
    clips: list[Sight] = []
    onsets: list[tuple[int, float]] = []
    torn = 0
    for at_ms, upper, lower in changes:
        if upper == lower == bars.SURROUND:
            if onsets:
                clips.append(Sight(tuple(onsets), at_ms, torn))
            onsets, torn = [], 0
        elif upper != lower or upper < 0:
            torn += 1
        elif not onsets or onsets[-1][0] != upper:
            onsets.append((upper, at_ms))
    return clips


def compare(record: Record, pressed_ms: float, sight: Sight, held_up: Sequence[tuple[float, float]]) -> Play:
    """Put one play's two sides together."""
    first: dict[int, float] = {}
    for index, at_ms in sight.onsets:
        first.setdefault(index, at_ms)
    drawn = {index: pressed_ms + since_key for index, since_key in record.drawn}
    lags = [at_ms - drawn[index] for index, at_ms in first.items() if index in drawn]
    delays = [at_ms - 1000 * index / record.fps for index, at_ms in first.items()]
    blind = [end - start for start, end in held_up if end > sight.onsets[0][1] and start < sight.ended_ms]
    return Play(
        record=record,
        pressed_ms=pressed_ms,
        sight=sight,
        missing=record.frames - len(first),
        worst_off_ms=_spread(lags),
        worst_late_ms=_spread(delays),
        key_to_pixel_ms=sight.onsets[0][1] - pressed_ms,
        lag_ms=median(lags) if lags else float("nan"),
        blind_ms=max(blind, default=0.0),
    )


def _spread(values: Sequence[float]) -> float:
    """The greatest distance from the median."""
    middle = median(values) if values else 0.0
    return max((abs(value - middle) for value in values), default=float("inf"))


def pair(
    presses: Sequence[float], seen: Sequence[Sight], records: Sequence[Record | None]
) -> list[int | None]:
    """Which sight belongs to each press: the one begun between it and the next one; None where none was."""
    if len(presses) != len(records):
        raise ValueError(f"{len(presses)} start keys were pressed, {len(records)} plays are stored")
    until = [*presses[1:], float("inf")]
    pairs: list[int | None] = []
    for start, end in zip(presses, until, strict=True):
        inside = [number for number, one in enumerate(seen) if start <= one.onsets[0][1] < end]
        pairs.append(inside[0] if inside else None)
    return pairs
