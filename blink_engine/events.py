"""What the caller tells the engine: moments at which people tend to blink."""

import math
from dataclasses import dataclass
from typing import Literal

EventKind = Literal[
    "utterance_start", "utterance_end", "pause", "turn_end", "gaze_shift", "head_turn", "blink"
]
EVENT_KINDS: tuple[EventKind, ...] = (
    "utterance_start",
    "utterance_end",
    "pause",
    "turn_end",
    "gaze_shift",
    "head_turn",
    "blink",
)


@dataclass(frozen=True)
class Event:
    """Something that happened at `time_s`.

    `amplitude_deg` is the size of a gaze shift or head turn; other kinds ignore it. A `blink` event always
    blinks, at once.
    """

    kind: EventKind
    time_s: float
    amplitude_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in EVENT_KINDS:
            raise ValueError(f"expected an event of kind {', '.join(EVENT_KINDS)}; got '{self.kind}'")
        if not math.isfinite(self.time_s) or not math.isfinite(self.amplitude_deg):
            raise ValueError(
                f"expected a finite time and amplitude, got {self.time_s} and {self.amplitude_deg}"
            )


@dataclass(frozen=True)
class Response:
    """How blinks answer events of one kind.

    `probability` of a blink, after a latency uniform between `earliest_s` and `latest_s`. Where
    `midpoint_deg` is positive, the probability grows with the size of the movement instead,
    1 / (1 + exp(-(|amplitude| - midpoint) / slope)).
    """

    probability: float
    earliest_s: float
    latest_s: float
    midpoint_deg: float = 0.0
    slope_deg: float = 1.0

    def chance(self, amplitude_deg: float) -> float:
        """Return the probability that an event of this size is answered by a blink."""
        if self.midpoint_deg <= 0.0:
            return self.probability
        return 1.0 / (1.0 + math.exp(-(abs(amplitude_deg) - self.midpoint_deg) / self.slope_deg))
