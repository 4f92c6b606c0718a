"""Estimated marginal means with their errors, and within-participant error bars."""

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.contrasts import effect_name

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MarginalMean:
    """Mean over participants of one margin's level, its SE and confidence interval on N - 1 df.

    `effect` names the margin; `levels` gives the level of each of its factors.
    """

    effect: str
    levels: dict[str, str]
    mean: float
    se: float
    ci: tuple[float, float]


def margin(result: AnovaResult, members: tuple[int, ...]) -> Floats:
    """Participants' means (N, levels of the margin) of the factors at `members`, last factor fastest."""
    away = tuple(axis + 1 for axis in range(len(result.factors)) if axis not in members)
    means: Floats = result.y.mean(axis=away).reshape(result.n_participants, -1)
    return means


def level_combinations(result: AnovaResult, members: tuple[int, ...]) -> list[dict[str, str]]:
    """Levels of a margin in the column order of `margin`."""
    names = [result.factors[m] for m in members]
    return [dict(zip(names, combo, strict=True)) for combo in product(*(result.levels[m] for m in members))]


def margins_shown(n_factors: int) -> list[tuple[int, ...]]:
    """Every margin of one and of two factors, then the cells."""
    margins = [m for order in (1, 2) for m in combinations(range(n_factors), order)]
    cells = tuple(range(n_factors))
    return margins if cells in margins else [*margins, cells]


def marginal_means(result: AnovaResult, confidence: float = 0.95) -> tuple[MarginalMean, ...]:
    """Estimated marginal means of every margin of one and two factors and of the cells.

    The mean of participants' marginal means, SE = sd / sqrt(N), interval from t(N - 1): SPSS's, and
    emmeans' with model = "multivariate".
    """
    return tuple(
        mean
        for members in margins_shown(len(result.factors))
        for mean in _means_of(result, members, confidence)
    )


def _means_of(result: AnovaResult, members: tuple[int, ...], confidence: float) -> list[MarginalMean]:
    values = margin(result, members)
    means, errors = values.mean(axis=0), standard_error(values)
    reach = float(special.stdtrit(result.n_participants - 1, 0.5 + confidence / 2))
    name = effect_name([result.factors[m] for m in members])
    return [
        MarginalMean(name, levels, float(m), float(se), (float(m - reach * se), float(m + reach * se)))
        for levels, m, se in zip(level_combinations(result, members), means, errors, strict=True)
    ]


def standard_error(values: Floats) -> Floats:
    """Standard error of the mean over participants (axis 0)."""
    error: Floats = values.std(axis=0, ddof=1) / np.sqrt(values.shape[0])
    return error
