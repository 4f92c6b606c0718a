"""Estimated marginal means with their errors."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.contrasts import effect_name
from analysis.within.estimates import Margin, margin_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MarginalMean:
    """Mean over participants of one margin's level, its SE and confidence interval on N - p df.

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


def margins_shown(n_factors: int) -> list[tuple[int, ...]]:
    """Every margin of one and of two factors, then the cells."""
    if n_factors == 0:
        return []
    margins = [m for order in (1, 2) for m in combinations(range(n_factors), order)]
    cells = tuple(range(n_factors))
    return margins if cells in margins else [*margins, cells]


def marginal_means(result: AnovaResult, confidence: float = 0.95) -> tuple[MarginalMean, ...]:
    """Estimated marginal means of every margin of one and two factors and of the cells.

    Means of the multivariate linear model, groups and levels averaged over with equal weight, covariates at
    their mean; intervals from t on N - p df. With one group this is the mean of participants' marginal
    means with SE = sd / sqrt(N): SPSS's, and emmeans' with model = "multivariate".
    """
    names = result.all_factors
    return tuple(
        mean
        for members in margins_shown(len(names))
        for mean in means_of(margin_of(result, [names[m] for m in members]), confidence)
    )


def means_of(margin: Margin, confidence: float = 0.95) -> list[MarginalMean]:
    """The means of one margin."""
    means, errors = margin.contrasts(np.eye(len(margin.combinations)))
    reach = float(special.stdtrit(margin.df, 0.5 + confidence / 2))
    name = effect_name(margin.names)
    return [
        MarginalMean(name, levels, float(m), float(se), (float(m - reach * se), float(m + reach * se)))
        for levels, m, se in zip(margin.combinations, means, errors, strict=True)
    ]
