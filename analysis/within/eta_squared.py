"""Effect sizes of within-participant tests and their confidence intervals."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

Floats = NDArray[np.float64]


_STEPS = 80
_RELATIVE_CHANGE = 1e-13


def noncentrality(f_value: Floats, df_effect: Floats, df_error: Floats, tail: Floats) -> Floats:
    """Solve P(F'(df_effect, df_error, L) <= f_value) = tail for L; 0 where no L >= 0 does.

    All arguments broadcast. Newton steps on the exact derivative, kept inside a bracket.
    """
    f, d1, d2, p = (
        np.array(a, dtype=np.float64) for a in np.broadcast_arrays(f_value, df_effect, df_error, tail)
    )
    solved = np.zeros_like(f)
    rooted = special.ncfdtr(d1, d2, 0.0, f) > p
    if rooted.any():
        solved[rooted] = _newton(f[rooted], d1[rooted], d2[rooted], p[rooted])
    return solved


def _newton(f: Floats, d1: Floats, d2: Floats, p: Floats) -> Floats:
    r"""The root of :math:`G(L) = P(F'_{d_1, d_2}(L) \le f) - p`.

    Notes
    -----
    A noncentral F is a mixture over a Poisson count with mean L/2, each one more adding two df:

    .. math::

        G'(L) = \tfrac{1}{2} \{P(F'_{d_1 + 2, d_2}(L) \le f d_1 / (d_1 + 2))
            - P(F'_{d_1, d_2}(L) \le f)\} \tag{1}

    d1, d2 are the df of effect and error, L the noncentrality. A step that leaves the bracket halves it.
    """
    low, high = np.zeros_like(f), d1 * f + 10.0
    while (short := special.ncfdtr(d1, d2, high, f) > p).any():
        high[short] *= 2.0
    guess = np.clip(d1 * f - special.ndtri(p) * np.sqrt(4.0 * d1 * f), 0.05 * high, 0.9 * high)
    for _ in range(_STEPS):
        cdf = special.ncfdtr(d1, d2, guess, f)
        above = cdf > p
        low, high = np.where(above, guess, low), np.where(above, high, guess)
        # eq. 1
        slope = 0.5 * (special.ncfdtr(d1 + 2.0, d2, guess, f * d1 / (d1 + 2.0)) - cdf)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = guess - (cdf - p) / slope
        bad = ~((step > low) & (step < high))
        following = np.where(bad, 0.5 * (low + high), step)
        done = np.abs(following - guess) <= _RELATIVE_CHANGE * following
        guess = following
        if done.all():
            break
    return guess


def partial_eta_squared_ci(
    f_value: Floats, df_effect: Floats, df_error: Floats, confidence: float = 0.95
) -> Floats:
    """Confidence interval of partial eta squared from its F.

    Parameters
    ----------
    f_value, df_effect, df_error : float64 array (m,)
        Univariate F with its uncorrected df; NaN gives NaN.
    confidence : float, optional
        Coverage of the two-sided interval.

    Returns
    -------
    (m, 2) lower and upper bound, L / (L + df_effect + df_error + 1) with L the noncentrality that puts F
    at the upper and lower tail. Source: Steiger (2004), doi:10.1037/1082-989X.9.2.164.
    """
    f, d1, d2 = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (f_value, df_effect, df_error))
    interval = np.full((f.size, 2), np.nan)
    known = np.isfinite(f)
    tails = np.array([0.5 + confidence / 2, 0.5 - confidence / 2])
    size = noncentrality(f[known, None], d1[known, None], d2[known, None], tails)
    interval[known] = size / (size + (d1 + d2 + 1.0)[known, None])
    return interval


class SizeIntervals:
    """Intervals of partial eta squared of several F, computed together when the first is asked for.

    Parameters
    ----------
    tests : sequence of (float, float, float)
        F and its df of effect and error, as in `partial_eta_squared_ci`.
    confidence : float
        Coverage.
    """

    def __init__(self, tests: Sequence[tuple[float, float, float]], confidence: float) -> None:
        self._tests = tests
        self._confidence = confidence

    def interval(self, at: int) -> tuple[float, float]:
        """Lower and upper bound of the F at a position."""
        return self._all_intervals[at]

    @cached_property
    def _all_intervals(self) -> list[tuple[float, float]]:
        f_value, df_effect, df_error = np.array(self._tests, dtype=np.float64).T
        bounds = partial_eta_squared_ci(f_value, df_effect, df_error, self._confidence)
        return [(low, high) for low, high in bounds.tolist()]
