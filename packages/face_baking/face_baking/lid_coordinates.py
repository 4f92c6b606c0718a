"""Where the vertices of the refined skin lie on the lids."""

from dataclasses import dataclass

import numpy as np

from face_baking.blink_path import BlinkPath, corner_line
from face_baking.kit import Array
from face_baking.lid_loops import LOOPS, SIDES
from face_baking.sphere import spherical
from face_baking.subdivision import Subdivision
from stimuli_builder.characters.colour import smooth

LID_MIDDLE = 0.15
"""Azimuth half way along the lids, radians."""


@dataclass(frozen=True, eq=False)
class LidCoordinates:
    """Where each fine vertex lies on the lids.

    Attributes
    ----------
    loop : float64 array (n,)
        Loop of vertices, continued between the loops; 14 beyond the last.
    upper : float64 array (n,)
        1 above the line through the eye's corners, 0 below.
    azimuth : float64 array (n,)
        About the globe of its side, toward the temple, radians.
    side : float64 array (n,)
        1 on the person's left, -1 on the right.
    """

    loop: Array
    upper: Array
    azimuth: Array
    side: Array


def lid_coordinates(path: BlinkPath, fine: Subdivision, rest: Array) -> LidCoordinates:
    """Coordinates of the refined skin's (n, 3) resting vertices."""
    number = np.full(len(path.rest), float(LOOPS))
    for side in SIDES:
        for k, loop in enumerate(path.loops[side]):
            number[loop] = k
    sides = np.where(rest[:, 0] >= 0, 1.0, -1.0)
    upper, azimuth = np.zeros(len(rest)), np.zeros(len(rest))
    for side in SIDES:
        here = (sides == side) & (rest[:, 2] > 4)
        _, turned, elevation = spherical(rest[here] - path.globes[side].centre)
        nasal, height, slope, _ = corner_line(path, side)
        azimuth[here] = turned * side
        upper[here] = smooth(-0.03, 0.05, elevation - (height + slope * (turned * side - nasal)))
    return LidCoordinates(fine(number), upper, azimuth, sides)
