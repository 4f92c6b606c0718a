"""Whether lids move at all: in a picture that stands still only noise and the codec move them."""

import math

import numpy as np

from stimuli_builder.compiled import compiled_over
from stimuli_builder.tracking import shapes
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points

WINDOW_S = 2.0
LEAST_FRAMES = 10
"""Frames that a window holds at least; below 5 frames/s it is longer, as a calm person's lids may be alike in
two frames."""
STILL_SHARE = 0.002
"""Root mean square move about their mean over two seconds, as part of the eye's width, below which lids are
still: 0.06 mm. Still pictures have 0.16% or less under noise, and where a codec has settled; the calmest two
seconds of three actors have 1.2%, of two recordings 4% (most hold a blink)."""


class Stillness:
    """The last two seconds of points, or ten frames where those last longer, of frames that show any.

    Attributes
    ----------
    window : int
        Frames of it.
    """

    def __init__(self, fps: float):
        self.window = max(LEAST_FRAMES, round(WINDOW_S * fps))
        self._count = 0
        self._first: Points | None = None

    def after(self, points: Points) -> bool:
        """Take in the points of the next frame.

        Parameters
        ----------
        points : (9 * eyes, 2) array
            In pixels.

        Returns
        -------
        bool
            True where the window is full and the lids stood still all through it.
        """
        if self._first is None:
            self._first = points.copy()
            self._ring = np.zeros((self.window, *points.shape))
            self._sum, self._squares = np.zeros(points.shape), np.zeros(points.shape)
        oldest = self._ring[self._count % self.window]
        share = moved_share(points, self._first, oldest, self._sum, self._squares, self.window)
        self._count += 1
        return self._count >= self.window and share < STILL_SHARE

    def forget(self) -> None:
        """Start again: a frame showed no eyes."""
        self._count, self._first = 0, None


@compiled_over(shapes)
def moved_share(
    points: Points, first: Points, oldest: Points, sums: Points, squares: Points, frames: int
) -> float:
    """Take a frame's points into a window, and return how far the points of the window move.

    Parameters
    ----------
    points, first : (9 * eyes, 2) array
        Points of this frame and of the first one, in pixels.
    oldest, sums, squares : (9 * eyes, 2) array
        Points of the window's oldest frame, and sum and sum of squares over it, as differences from `first`.
        All three are changed in place.
    frames : int
        Frames of the window.

    Returns
    -------
    float
        Root mean square distance of a coordinate from its mean over the window, as part of the width that the
        eyes have in this frame.
    """
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
    width = 0.0
    for start in range(0, points.shape[0], EYE_POINTS):
        along = points[start + CANTHI[1]] - points[start + CANTHI[0]]
        width += math.hypot(along[0], along[1]) * EYE_POINTS / points.shape[0]
    return math.sqrt(max(variance, 0.0) / points.size) / max(width, 1e-6)
