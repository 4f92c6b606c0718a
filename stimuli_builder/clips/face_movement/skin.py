"""How the skin round an eye follows brow, cheek and squint: fields of displacement in the picture.

Positions are in mm from the middle of the open eye: x to the temple, y up. A part that moves by its amount m
at closure 1 displaces the picture at closure w by

    d(x, y; w) = w m F(x, y) u,      F = exp(-|(x - c) / s|^p / 2) S(y)                                    (1)

Letters: u the direction (unit length), c and s the middle and the spread along x, p how steep its ends are,
S a smoothstep that is 0 on the lids and 1 where the part lies. The numbers of brow, cheek and squint follow
the front of ICT-FaceKit's mean shapes browDown, cheekSquint and eyeSquint (decision 0737).
"""

from dataclasses import dataclass

import numpy as np

from stimuli_builder.characters.facekit.kit import Array
from stimuli_builder.characters.facekit.sphere import smooth


@dataclass(frozen=True)
class SkinField:
    """One part's field: equation (1) at m = w = 1."""

    direction: tuple[float, float]
    middle_mm: float
    spread_mm: float
    still_mm: float
    """Height at which S begins to leave 0."""
    whole_mm: float
    """Height at which S reaches 1."""
    power: float = 2.0

    def share(self, x_mm: Array, y_mm: Array) -> Array:
        """F in 0-1 at positions relative to one eye."""
        along = np.exp(-(np.abs((x_mm - self.middle_mm) / self.spread_mm) ** self.power) / 2)
        return np.asarray(along * smooth(self.still_mm, self.whole_mm, y_mm))


FIELDS = {
    "brow": SkinField((-0.71, -0.71), 5.0, 13.0, 9.0, 17.0),
    "cheek": SkinField((-0.21, 0.98), 17.0, 15.0, -6.5, -19.0),
    "squint": SkinField((-0.71, 0.71), 5.0, 12.0, -6.5, -15.0),
}
DRAWN_BROW = SkinField((0.0, -1.0), 3.0, 27.0, 4.5, 6.5, power=16.0)
"""The cartoon's brows sink whole, as they are drawn to do."""
