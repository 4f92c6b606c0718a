"""Pairs of levels by trimmed means: Yuen's tests, dependent within participants, Welch's between groups."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.adjustments import holm
from analysis.within.anova import AnovaResult

Floats = NDArray[np.float64]

TRIM = 0.2
"""Share of participants left out at each end."""


@dataclass(frozen=True)
class TrimmedPair:
    """Difference of two levels' trimmed means over participants, level_a minus level_b.

    `p_holm` is adjusted for the pairs of the margin. NaN where too few are left or nothing varies.
    """

    effect: str
    level_a: str
    level_b: str
    difference: float
    se: float
    t: float
    df: float
    p: float
    p_holm: float
    ci: tuple[float, float]


def trimmed_pairs(
    result: AnovaResult, trim: float = TRIM, confidence: float = 0.95
) -> tuple[TrimmedPair, ...]:
    r"""Compare all pairs of levels of every factor by trimmed means.

    Parameters
    ----------
    result : AnovaResult
    trim : float
        Share of participants left out at each end, from 0 to below 0.5.
    confidence : float
        Coverage of the intervals.

    Returns
    -------
    tuple of TrimmedPair

    Notes
    -----
    Of n participants :math:`g = \lfloor n \, trim \rfloor` are left out at each end, :math:`h = n - 2 g`
    remain; x and y are their means at the two levels, :math:`s` the covariances of the values with the g
    outermost pulled in to the next (winsorised):

    1. within: :math:`SE^2 = (n - 1)(s_{xx} + s_{yy} - 2 s_{xy}) / (h (h - 1))`, df :math:`h - 1`;
    2. between: :math:`SE^2 = d_x + d_y`, :math:`d = (n - 1) s / (h (h - 1))`, df
       :math:`SE^4 / (d_x^2 / (h_x - 1) + d_y^2 / (h_y - 1))`.

    Groups are pooled where a level within participants is compared. Sources: Yuen (1974),
    doi:10.1093/biomet/61.1.165; Wilcox (2012), *Introduction to Robust Estimation*, 5.3 and 5.9.
    """
    pairs: list[TrimmedPair] = []
    for axis, (name, levels) in enumerate(zip(result.factors, result.levels, strict=True)):
        others = tuple(k + 1 for k in range(len(result.factors)) if k != axis)
        samples = list(result.y.mean(axis=others).T)
        pairs += _compared(name, levels, samples, _dependent, trim, confidence)
    people = result.y.reshape(len(result.y), -1).mean(axis=1)
    for column, (name, levels) in enumerate(zip(result.between.factors, result.between.levels, strict=True)):
        samples = [people[result.between.codes[:, column] == code] for code in range(len(levels))]
        pairs += _compared(name, levels, samples, _independent, trim, confidence)
    return tuple(pairs)


def _dependent(x: Floats, y: Floats, trim: float) -> tuple[float, float, float]:
    """Difference, its standard error and df (equation 1)."""
    n, kept = len(x), _kept(len(x), trim)
    # the variance of the differences is s_xx + s_yy - 2 s_xy without the rounding of that sum
    spread = _above_noise((_winsorised(x, trim) - _winsorised(y, trim)).var(ddof=1), x, y)
    variance = (n - 1) * spread / (kept * (kept - 1)) if kept > 1 else np.nan
    return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), float(np.sqrt(variance)), kept - 1


def _independent(x: Floats, y: Floats, trim: float) -> tuple[float, float, float]:
    """Difference, its standard error and df (equation 2)."""
    kept = np.array([_kept(len(x), trim), _kept(len(y), trim)])
    if (kept < 2).any():
        return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), np.nan, np.nan
    s = np.array([_above_noise(_winsorised(values, trim).var(ddof=1), x, y) for values in (x, y)])
    d = (np.array([len(x), len(y)]) - 1) * s / (kept * (kept - 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        df = d.sum() ** 2 / (d**2 / (kept - 1)).sum()
    return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), float(np.sqrt(d.sum())), float(df)


def _above_noise(variance: float, x: Floats, y: Floats) -> float:
    """The variance, or exactly zero where it is no more than rounding of means."""
    largest = max(float(np.abs(x).max()), float(np.abs(y).max()))
    return variance if variance > (8 * np.finfo(float).eps * largest) ** 2 else 0.0


def _cut(n: int, trim: float) -> int:
    return int(np.floor(trim * n + 1e-9))


def _kept(n: int, trim: float) -> int:
    return n - 2 * _cut(n, trim)


def _trimmed_mean(values: Floats, trim: float) -> float:
    cut = _cut(len(values), trim)
    return float(np.sort(values)[cut : len(values) - cut].mean())


def _winsorised(values: Floats, trim: float) -> Floats:
    cut, ordered = _cut(len(values), trim), np.sort(values)
    return np.clip(values, ordered[cut], ordered[len(values) - cut - 1])


def _compared(
    effect: str,
    levels: Sequence[str],
    samples: Sequence[Floats],
    test: Callable[[Floats, Floats, float], tuple[float, float, float]],
    trim: float,
    confidence: float,
) -> list[TrimmedPair]:
    """Every pair of the levels by `test`, which gives difference, standard error and df."""
    compared = list(combinations(range(len(levels)), 2))
    difference, se, df = np.array([test(samples[a], samples[b], trim) for a, b in compared]).T
    with np.errstate(invalid="ignore", divide="ignore"):
        t = np.where(se > 0, difference / se, np.nan)
    p = 2 * special.stdtr(df, -np.abs(t))
    adjusted = np.where(np.isnan(p), np.nan, holm(p))
    reach = special.stdtrit(df, 0.5 + confidence / 2) * se
    return [
        TrimmedPair(
            effect,
            levels[a],
            levels[b],
            float(difference[i]),
            float(se[i]),
            float(t[i]),
            float(df[i]),
            float(p[i]),
            float(adjusted[i]),
            (float(difference[i] - reach[i]), float(difference[i] + reach[i])),
        )
        for i, (a, b) in enumerate(compared)
    ]
