"""The p values that a printed statistic and its df allow."""

from itertools import product
from typing import Literal

import numpy as np
from scipy import special

from analysis.paper.printed import Rounded

Kind = Literal["F", "t", "chi2", "r", "z"]


def corners(printed: str, whole_is_exact: bool = False) -> tuple[float, ...]:
    """The ends of what rounds to a printed number."""
    if whole_is_exact and "." not in printed:
        return (float(printed),)
    rounded = Rounded.of(printed)
    return float(rounded.low), float(rounded.high)


def p_range(kind: Kind, df: tuple[str, ...], value: str) -> tuple[float, float]:
    """Smallest and largest p that a printed statistic allows, two-sided for t, r and z."""
    low, high = corners(value.lstrip("-"))
    values = [max(low, 0.0), high]  # 0.00 can have been anything from 0 on
    degrees = product(*(corners(d, whole_is_exact=True) for d in df))
    p = [_p(kind, at, v) for at in degrees for v in values]
    return min(p), max(p)


def _p(kind: Kind, df: tuple[float, ...], value: float) -> float:
    if min(df, default=1.0) <= 0:
        return float("nan")
    if kind == "F":
        return float(special.fdtrc(df[0], df[1], value))
    if kind == "t":
        return float(2 * special.stdtr(df[0], -value))
    if kind == "chi2":
        return float(special.chdtrc(df[0], value))
    if kind == "r":
        r = min(value, 1 - 1e-12)
        return float(2 * special.stdtr(df[0], -r * np.sqrt(df[0] / (1 - r * r))))
    return float(2 * special.ndtr(-value))
