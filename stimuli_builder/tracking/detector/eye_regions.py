"""The squares in which the iris network reads an eye, and what it answers with."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from stimuli_builder.tracking.shapes import Points

SIDE_OF_WIDTH = 2.9
"""Side of the region in which an eye is read, in its widths."""
VIEWS = tuple((dy, turn) for dy in (-0.24, -0.16, -0.08) for turn in (-10, 0, 10))
"""A close-up's eye is read in all of these and the mean taken: shift down in its widths, turn in degrees."""


class Region(NamedTuple):
    """A square that the iris network sees: middle and side in pixels, mirrored or not, turn in degrees."""

    x: float
    y: float
    side: float
    flip: bool
    turn: float = 0.0

    def views(self, width: float) -> "list[Region]":
        """The regions about this one in which an eye of such a width in pixels is read."""
        return [Region(self.x, self.y + dy * width, self.side, self.flip, turn) for dy, turn in VIEWS]


def contours_of(eyes: Sequence[Any]) -> Points:
    """What the iris network answers with, as contours (eyes, 16, 2)."""
    return np.array([[*upper, *lower[1:-1]] for upper, lower, _ in eyes])
