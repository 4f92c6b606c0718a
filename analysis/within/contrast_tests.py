"""Planned contrasts of a margin, polynomial trends, and equivalence within declared bounds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.estimates import margin_of
from analysis.within.pairwise import Pair
from experiments.errors import InputError

Floats = NDArray[np.float64]

DEGREES = ("linear", "quadratic", "cubic", "quartic", "quintic")


@dataclass(frozen=True)
class Contrast:
    """A weighted sum of the means of one factor, tested by t on N - p df."""

    factor: str
    name: str
    weights: tuple[float, ...]
    estimate: float
    se: float
    t: float
    df: int
    p: float
    ci: tuple[float, float]


@dataclass(frozen=True)
class Equivalence:
    """Two one-sided tests that a difference lies within (low, high), in units of the rating.

    `p` is the larger of the two; `ci` has coverage 1 - 2 alpha: equivalence at alpha = .05 is the 90%
    interval inside the bounds. Source: Schuirmann (1987); Lakens (2017).
    """

    effect: str
    level_a: str
    level_b: str
    difference: float
    bounds: tuple[float, float]
    p_lower: float
    p_upper: float
    p: float
    ci: tuple[float, float]
    cell_a: dict[str, str]
    cell_b: dict[str, str]


def contrasts_of(
    result: AnovaResult, factor: str, named: Sequence[tuple[str, Sequence[float]]], confidence: float = 0.95
) -> tuple[Contrast, ...]:
    """Test contrasts of a factor's means, weights in the order of its levels.

    Raises
    ------
    InputError
        Weights that do not sum to zero or are not one for each level.
    """
    margin = margin_of(result, [factor])
    for name, weights in named:
        if len(weights) != len(margin.combinations):
            raise InputError(
                f"contrast '{name}' of '{factor}' has {len(weights)} weights for "
                f"{len(margin.combinations)} levels"
            )
        # Relative to the weights: thirds and sixths do not sum to 0 exactly.
        if abs(sum(weights)) > 1e-9 * max(1.0, *map(abs, weights)) or not any(weights):
            raise InputError(
                f"the weights of contrast '{name}' of '{factor}' should sum to zero, and not all be zero"
            )
    every = np.array([weights for _, weights in named], dtype=np.float64)
    # Weights of a contrast may be of any size: so is what rounding leaves of it.
    scale = float(np.abs(result.y).max()) * max(1.0, float(np.abs(every).sum(axis=1).max()))
    estimates, errors, t = margin.tested(every, scale)
    # The lower tail twice keeps the digits of small p.
    p = 2 * special.stdtr(margin.df, -np.abs(t))
    reach = float(special.stdtrit(margin.df, 0.5 + confidence / 2)) * errors
    return tuple(
        Contrast(
            factor=factor,
            name=name,
            weights=tuple(float(w) for w in weights),
            estimate=float(estimates[i]),
            se=float(errors[i]),
            t=float(t[i]),
            df=margin.df,
            p=float(p[i]),
            ci=(float(estimates[i] - reach[i]), float(estimates[i] + reach[i])),
        )
        for i, (name, weights) in enumerate(named)
    )


def polynomial_weights(values: Sequence[float]) -> Floats:
    """Orthonormal polynomial contrasts (degrees, levels) of levels at `values`, spaced as they are."""
    x = np.array(values, dtype=np.float64)
    # Centered and within one unit: powers of large numbers would nearly coincide.
    powers = np.vander((x - x.mean()) / np.ptp(x), len(x), increasing=True)
    basis, triangle = np.linalg.qr(powers)
    # The sign that makes each trend rise at the end; the constant first row is left out.
    return np.asarray((basis * np.sign(np.diag(triangle))).T[1:], dtype=np.float64)


def trends(result: AnovaResult) -> tuple[Contrast, ...]:
    """Polynomial trends of every factor with three or more levels whose names are all numbers."""
    contrasts: list[Contrast] = []
    for factor, levels in zip(result.all_factors, result.all_levels, strict=True):
        values = _as_numbers(levels)
        # Two levels have one difference, which the pairs test.
        if values is None or len(levels) < 3:
            continue
        weights = polynomial_weights(values)[: len(DEGREES)]
        # `strict=False`: fewer levels than degrees.
        contrasts += contrasts_of(result, factor, list(zip(DEGREES, weights.tolist(), strict=False)))
    return tuple(contrasts)


def _as_numbers(levels: Sequence[str]) -> list[float] | None:
    try:
        values = [float(level) for level in levels]
    except ValueError:
        return None
    # Two names of one number (1 and 1.0) would have no polynomial.
    return values if np.isfinite(values).all() and len(set(values)) == len(values) else None


def equivalence_p(difference: float, se: float, df: float, bounds: tuple[float, float]) -> float:
    """P of Schuirmann's (1987) two one-sided tests that a difference lies within bounds around zero."""
    low, high = bounds
    if not low < 0 < high:
        raise InputError(f"expected bounds around zero, like -0.5,0.5, got {low:g} and {high:g}")
    # Both as lower tails: the greater p has the greater value.
    above, below = -(difference - low) / se, (difference - high) / se
    # Infinite df: the normal distribution.
    if not np.isfinite(df):
        return float(special.ndtr(max(above, below)))
    return float(special.stdtr(df, max(above, below)))


def equivalence(
    pairs: Sequence[Pair], low: float, high: float, alpha: float = 0.05
) -> tuple[Equivalence, ...]:
    """Test every pair for equivalence within (low, high); pairs that do not vary are left out."""
    if not low < 0 < high:
        raise InputError(f"expected bounds around zero, like -0.5,0.5, got {low:g} and {high:g}")
    tests = []
    for pair in pairs:
        # A pair in which nobody differs has no standard error.
        if not np.isfinite(pair.t):
            continue
        lower = float(special.stdtr(pair.df, -(pair.difference - low) / pair.se))
        upper = float(special.stdtr(pair.df, (pair.difference - high) / pair.se))
        # 1 - alpha on each side: an interval of 1 - 2 alpha.
        reach = float(special.stdtrit(pair.df, 1 - alpha)) * pair.se
        tests.append(
            Equivalence(
                effect=pair.effect,
                level_a=pair.level_a,
                level_b=pair.level_b,
                difference=pair.difference,
                bounds=(low, high),
                p_lower=lower,
                p_upper=upper,
                p=max(lower, upper),
                ci=(pair.difference - reach, pair.difference + reach),
                cell_a=pair.cell_a,
                cell_b=pair.cell_b,
            )
        )
    return tuple(tests)
