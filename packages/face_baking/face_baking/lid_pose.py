"""Position of the lids."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LidPose:
    """Closure 0-1; the lower lid's middle `vertical_mm` up and `horizontal_mm` toward the nose.

    Millimeters are declared ones: the eyes lie 60 mm apart (framing.py).
    """

    closure: float
    vertical_mm: float = 0.0
    horizontal_mm: float = 0.0


# What a blink does to the lower lid reaches 1 mm upwards and 5 mm toward the nose (blinks/lower_lid.py).
VERTICAL_MM = (0.0, 0.5, 1.0)
HORIZONTAL_MM = tuple(k / 2 for k in range(11))
RENDERED_HORIZONTAL_MM = HORIZONTAL_MM[::2]
"""Slides in between are moved from these as the mesh moves."""
OPEN, SHUT = LidPose(0.0), LidPose(1.0)
