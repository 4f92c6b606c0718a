"""What came of a frame, and of a recording."""

import re
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.tracking.shapes import Points

Status = Literal["tracked", "reinitialised", "doubtful", "lost"]


@dataclass(frozen=True)
class TrackedFrame:
    """One frame's outcome; `points` and `distances` are None exactly when `status` is 'lost'.

    Attributes
    ----------
    points : float64 array (9 * eyes, 2) or None
        In pixels of the video.
    distances : float64 array (eyes,) or None
        In pixels, image-left eye first.
    residual : float or None
        Root mean square grey levels over all base pixels; None if no fit came to an end.
    errors : float64 array (9 * eyes,) or None
        Stated error of each point in pixels.
    """

    status: Status
    reason: str
    points: Points | None
    distances: NDArray[np.float64] | None
    residual: float | None
    iterations: int
    errors: NDArray[np.float64] | None = None


@dataclass
class TrackSummary:
    """Counts and speeds of one run.

    Attributes
    ----------
    repeated : int
        Frames that repeat the one before at even steps, see `Hindsight`.
    fit_s : float
        Processor time of fitting alone.
    reasons : dict
        Status (doubtful or lost) and the words of a reason -> frames, the first of them, its whole reason.
    """

    frames: int = 0
    tracked: int = 0
    reinitialised: int = 0
    doubtful: int = 0
    lost: int = 0
    repeated: int = 0
    fit_s: float = 0.0
    total_s: float = 0.0
    reasons: dict[tuple[str, str], tuple[int, int, str]] = field(default_factory=dict)

    @property
    def fit_fps(self) -> float:
        """Frames fitted per second of fitting."""
        return self.frames / max(self.fit_s, 1e-9)

    @property
    def end_to_end_fps(self) -> float:
        """Frames per second with decoding and writing."""
        return self.frames / max(self.total_s, 1e-9)

    def count(self, frame: TrackedFrame) -> None:
        """Take in the next frame's outcome."""
        if frame.status in ("doubtful", "lost"):
            kind = (frame.status, re.split(r"[:(]|\d", frame.reason)[0].strip())
            number, first, whole = self.reasons.get(kind, (0, self.frames, frame.reason))
            self.reasons[kind] = (number + 1, first, whole)
        self.frames += 1
        self.tracked += frame.status != "lost"
        self.doubtful += frame.status == "doubtful"
        self.reinitialised += frame.status == "reinitialised"
        self.lost += frame.status == "lost"
