"""The few smooth functions that faces are modelled with here."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def bell(x: ArrayLike, sigma: float) -> Array:
    """Gaussian of height 1 at 0."""
    return np.asarray(np.exp(-0.5 * (np.asarray(x) / sigma) ** 2))


def step(start: float, end: float, x: ArrayLike) -> Array:
    """Rise from 0 at `start` to 1 at `end` (either order) with zero first and second derivatives."""
    t = np.clip((np.asarray(x, dtype=float) - start) / (end - start), 0, 1)
    return np.asarray(t * t * t * (t * (6 * t - 15) + 10))


def smooth_maximum(a: Array, b: Array, width: float) -> Array:
    """Maximum of two surfaces with a polynomial fillet of the given width."""
    h = np.clip(0.5 + 0.5 * (a - b) / width, 0, 1)
    return np.asarray(b + (a - b) * h + width * h * (1 - h))


def soft_maximum(a: Array, b: Array, width: float) -> Array:
    """Log-sum-exp maximum: no curvature ring at the joint, unlike a polynomial fillet."""
    larger = np.maximum(a, b)
    return np.asarray(larger + width * np.log(np.exp((a - larger) / width) + np.exp((b - larger) / width)))
