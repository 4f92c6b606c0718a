"""p values adjusted for the number of comparisons of one family.

statsmodels' `multipletests` gives the same and loads slowly; its Holm collects the process's garbage at each
call (0.2 s and more).
"""

import numpy as np
from numpy.typing import NDArray

from analysis.within.studentized_range import studentized_range_tail

Floats = NDArray[np.float64]


def bonferroni(p: Floats) -> Floats:
    """min(1, m p) for m values (m,); NaN stays NaN and counts in m."""
    return np.minimum(1.0, p.size * p)


def holm(p: Floats) -> Floats:
    """Holm's (1979) step-down values (m,): the running maximum of (m - i + 1) p(i)."""
    m, order = p.size, np.argsort(p, kind="stable")
    stepped = np.empty_like(p)
    stepped[order] = np.minimum(1.0, np.maximum.accumulate((m - np.arange(m)) * p[order]))
    return np.where(np.isnan(p), np.nan, stepped)


def sidak(p: Floats) -> Floats:
    """1 - (1 - p)^m (m,)."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(p.size * np.log1p(-p)), dtype=np.float64)


def false_discovery_rate(p: Floats) -> Floats:
    """Benjamini & Hochberg's (1995) values (m,): the running minimum of m p(i) / i from the largest down."""
    m, order = p.size, np.argsort(p, kind="stable")[::-1]
    stepped = np.empty_like(p)
    stepped[order] = np.minimum.accumulate(np.fmin(1.0, m / np.arange(m, 0, -1) * p[order]))
    return np.where(np.isnan(p), np.nan, stepped)


def tukey(t: Floats, means: int, df: int) -> Floats:
    r"""Tukey's honest significant difference of t statistics (m,) among `means` means on `df` error df.

    The upper tail of the studentized range at :math:`q = \sqrt 2 |t|` (see `studentized_range_tail`).
    """
    q = np.sqrt(2.0) * np.abs(np.atleast_1d(t))
    return np.array([np.nan if np.isnan(one) else studentized_range_tail(one, means, df) for one in q])
