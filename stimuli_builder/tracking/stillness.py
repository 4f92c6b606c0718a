"""Whether lids move at all: in a picture that stands still only noise and the codec move them."""

import numpy as np

from stimuli_builder.compiled import compiled
from stimuli_builder.tracking.shapes import Points, widths

WINDOW_S = 2.0
STILL_SHARE = 0.002
"""Root mean square move about their mean over two seconds, as part of the eye's width, below which lids stand
still: 0.06 mm. Still pictures have 0.16% or less under noise, and where a codec has settled; the calmest two
seconds of three actors have 1.2%, of two recordings 4% (most hold a blink)."""


class Stillness:
    """The last two seconds of points, of frames that show any."""

    def __init__(self, fps: float):
        self._window = max(2, round(WINDOW_S * fps))
        self._count = 0
        self._first: Points | None = None

    def after(self, points: Points) -> bool:
        """Take in the next frame's points (n, 2) in pixels; whether they have stood still for two seconds."""
        if self._first is None:
            self._first = points.copy()
            self._limit = (STILL_SHARE * widths(points)) ** 2
            self._ring = np.zeros((self._window, *points.shape))
            self._sum, self._squares = np.zeros(points.shape), np.zeros(points.shape)
        oldest = self._ring[self._count % self._window]
        variance = taken_in(points, self._first, oldest, self._sum, self._squares, self._window)
        self._count += 1
        return self._count >= self._window and variance < self._limit

    def forget(self) -> None:
        """Begin anew: a frame showed no eyes."""
        self._count, self._first = 0, None


@compiled
def taken_in(
    points: Points, first: Points, oldest: Points, sums: Points, squares: Points, frames: int
) -> float:
    """Mean variance in square pixels after points (n, 2) took the place of the oldest."""
    variance = 0.0
    for point in range(points.shape[0]):
        for axis in range(2):
            # Relative to the first frame's, so that squares keep their digits.
            new, old = points[point, axis] - first[point, axis], oldest[point, axis]
            sums[point, axis] += new - old
            squares[point, axis] += new * new - old * old
            oldest[point, axis] = new
            mean = sums[point, axis] / frames
            variance += squares[point, axis] / frames - mean * mean
    return variance / points.size
