"""The light of a recording against that of its labeled frames: a gain and an offset of the gray levels."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled
from stimuli_builder.video import Picture

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
    if not both > 1e-3 * spread:
        return 0.0, 0.0
    gain = spread / both
    return gain, mean_look - gain * mean_sampled
