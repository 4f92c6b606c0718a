"""How the lids stand."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LidPose:
    """Closure 0-1; the lower lid's middle `vertical_mm` up and `horizontal_mm` towards the nose.

    Millimetres are declared ones: the eyes lie 60 mm apart (framing.py).
    """

    closure: float
    vertical_mm: float = 0.0
    horizontal_mm: float = 0.0


OPEN, SHUT = LidPose(0.0), LidPose(1.0)
