"""Whether lids move at all, and how the light of a recording differs from that of its labeled frames."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled, compiled_over
from stimuli_builder.tracking import shapes
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points
from stimuli_builder.video import Picture

# Whether lids move at all: in a picture that stands still only noise and the codec move them.

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
        # A ring of frames and running sums, so that a frame costs the same whatever the window's length.
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


# The light of a recording against that of its labeled frames: a gain and an offset of the gray levels.

Values = NDArray[np.float32]

STEADY_LEVELS = 4.0
"""A change of light that moves no gray level by more is left alone: even light changes no track."""
DARK, BRIGHT = 30.0, 220.0
"""Gray levels of eyes between which a change of light is judged."""
SHARE = 0.2
"""Part of what a frame says of the light that is taken over; the rest is as before."""
RETURN = 0.02
"""Part by which the light goes back to that of the labeled frames with every frame: the model's own modes
of brightness can take the place of a gain, and nothing else would keep the two from drifting apart."""
GAINS = (0.5, 2.0)
"""Gains believed; beyond them few gray levels are left, and a covered eye might be made to look like one."""


@dataclass(frozen=True)
class Light:
    """Gray levels v of a recording are gain v + offset in the light of the labeled frames."""

    gain: float = 1.0
    offset: float = 0.0

    @property
    def steady(self) -> bool:
        """Whether no gray level of an eye would move by more than four."""
        # A line is farthest from another at one of the ends, so two levels are enough.
        ends = [abs((self.gain - 1) * level + self.offset) for level in (DARK, BRIGHT)]
        return max(ends) <= STEADY_LEVELS

    @property
    def believable(self) -> bool:
        """Whether the gain is one that a change of light has."""
        return GAINS[0] <= self.gain <= GAINS[1]

    def evened(self, picture: Picture) -> Picture:
        """The gray picture (h, w) as it would be in the light of the labeled frames."""
        if self.steady:
            return picture
        # A table of 256 entries, as a picture has far more pixels than gray levels.
        levels = np.clip(np.rint(self.gain * np.arange(256) + self.offset), 0, 255).astype(np.uint8)
        return np.asarray(cv2.LUT(picture, levels), np.uint8)

    def then(self, gain: float, offset: float) -> "Light":
        """This light followed by what is left of it in an evened picture."""
        return Light(gain * self.gain, gain * self.offset + offset)

    def following(self, gain: float, offset: float) -> "Light":
        """This light a part of the way on to what an evened picture says, and back toward none."""
        seen = self.then(gain, offset)
        if not seen.believable:
            return self
        kept = 1 - RETURN
        return Light(
            1 + kept * (self.gain + SHARE * (seen.gain - self.gain) - 1),
            kept * (self.offset + SHARE * (seen.offset - self.offset)),
        )


@compiled
def light_between(look: Values, sampled: Values, weights: Values) -> tuple[float, float]:
    """Gain and offset that bring sampled gray levels (N,) to a model's look (N,), float32; weights (N,).

    The noise is in the samples, so that they are regressed on the look and the line is turned round: a gain
    regressed the other way would come out low by what the model does not explain, frame after frame.
    """
    total, mean_look, mean_sampled = 0.0, 0.0, 0.0
    for x in range(look.shape[0]):
        total += weights[x]
        mean_look += weights[x] * look[x]
        mean_sampled += weights[x] * sampled[x]
    mean_look /= total
    mean_sampled /= total
    spread, both = 0.0, 0.0
    for x in range(look.shape[0]):
        away = look[x] - mean_look
        spread += weights[x] * away * away
        both += weights[x] * away * (sampled[x] - mean_sampled)
    # Hardly related, or reversed: no change of light does this. A gain of 0 is not believed by any caller.
    if not both > 1e-3 * spread:
        return 0.0, 0.0
    gain = spread / both
    return gain, mean_look - gain * mean_sampled
