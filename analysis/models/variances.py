"""Relative standard deviations that minimise the criterion of a mixed model."""

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from analysis.models.reml import CrossProducts, criterion

Floats = NDArray[np.float64]

ZERO_THETA = 1e-4
"""A relative SD below this is tried at zero, its bound."""

SINGULAR_THETA = 1e-4
"""A standard deviation below this share of the residual's counts as zero."""

START = 0.4
"""Relative standard deviation to start from."""

LIFTS = (0.003, 0.01, 0.03, 0.1, 0.3)

ROUGHLY = 1e-5
"""The descent ends where a step lowers the criterion by less than this; Newton steps go on from there."""

NEWTON_STEPS = 8

NEWTON_DECREMENT = 1e-8
"""A step that promised less than this of the criterion was the last."""


def fit_theta(c: CrossProducts) -> Floats:
    """Minimise; a theta that ended at zero, always stationary, is lifted where zero is no minimum."""
    # theta on the diagonal of a factor cannot be negative
    bounded = [bool(np.trace(pattern) > 0) for block in c.blocks for pattern in block.patterns]
    theta = _descend(c, np.where(bounded, START, 0.0), bounded, ROUGHLY)
    for _ in range(len(bounded)):
        lifted = _lifted(c, theta, bounded)
        if lifted is None:
            break
        theta = _descend(c, lifted, bounded, ROUGHLY)
    theta, settled = _polished(c, _zeroed(c, theta, bounded), bounded)
    if not settled:
        theta, _ = _polished(c, _zeroed(c, _descend(c, theta, bounded, 0.0), bounded), bounded)
    return theta


def _descend(c: CrossProducts, start: Floats, bounded: list[bool], least_fall: float) -> Floats:
    least = max(1e-14, least_fall / max(1.0, abs(criterion(c, start).value)))

    def objective(theta: Floats) -> tuple[float, Floats]:
        at = criterion(c, theta)
        return at.value, at.gradient

    optimum = optimize.minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, None) if b else (None, None) for b in bounded],
        options={"maxiter": 1000, "maxfun": 3000, "ftol": least, "gtol": 1e-8, "maxcor": 30},
    )
    return np.asarray(optimum.x, dtype=np.float64)


def _lifted(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats | None:
    """Theta with one entry lifted from zero where that lowers the criterion, else None."""
    at = criterion(c, theta)
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded) & (at.curve_at_zero < 0)):
        trials = np.repeat(theta[None], len(LIFTS), axis=0)
        trials[:, k] = LIFTS
        values = [criterion(c, trial).value for trial in trials]
        if min(values) < at.value - 1e-9:
            return np.asarray(trials[int(np.argmin(values))], dtype=np.float64)
    return None


def _zeroed(c: CrossProducts, theta: Floats, bounded: list[bool]) -> Floats:
    """Put tiny standard deviations at zero where that is no worse."""
    for k in np.flatnonzero((np.abs(theta) < ZERO_THETA) & np.array(bounded)):
        trial = theta.copy()
        trial[k] = 0.0
        if criterion(c, trial).value <= criterion(c, theta).value + 1e-9:
            theta = trial
    return theta


def _polished(c: CrossProducts, theta: Floats, bounded: list[bool]) -> tuple[Floats, bool]:
    """Newton steps on the free theta, with the Hessian from differences of the exact gradient.

    Also whether they arrived.
    """
    at = criterion(c, theta)
    for _ in range(NEWTON_STEPS):
        free = np.flatnonzero(np.abs(theta) > 0)
        if len(free) == 0 or np.abs(at.gradient[free]).max() < 1e-9:
            return theta, True
        hessian = np.stack([_gradient_slope(c, theta, at.gradient, int(k))[free] for k in free])
        values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
        if values.min() <= 1e-8 * values.max():
            break
        rotated = vectors.T @ at.gradient[free]
        trial = theta.copy()
        trial[free] -= vectors @ (rotated / values)
        if (trial[np.array(bounded)] < 0).any():
            break
        after = criterion(c, trial)
        if not after.value < at.value + 1e-10 * abs(at.value):
            break
        theta, at = trial, after
        if float(rotated @ (rotated / values)) < NEWTON_DECREMENT:
            return theta, True
    return theta, False


def _gradient_slope(c: CrossProducts, theta: Floats, gradient: Floats, k: int) -> Floats:
    step = 1e-5 * max(abs(float(theta[k])), 0.05)
    moved = theta.copy()
    moved[k] += step
    return (criterion(c, moved).gradient - gradient) / step
