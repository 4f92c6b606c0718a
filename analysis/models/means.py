"""Questions after a model: marginal means, their pairs, trends of covariates, likelihood-ratio tests."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.models.design import ModelData
from analysis.within.adjustments import bonferroni, holm, tukey
from analysis.within.contrast_tests import equivalence_p

Floats = NDArray[np.float64]

Estimate = tuple[float, float, float]
"""An estimate, its standard error, and the df of its t test; infinite df are a z test."""


@dataclass(frozen=True)
class ModelMean:
    """Mean of a margin's cell: other factors averaged with equal weights, covariates at their means.

    Of an ordinal model it is on the logit scale, from the middle of the thresholds.
    """

    margin: str
    levels: dict[str, str]
    estimate: float
    se: float
    df: float
    ci: tuple[float, float]


@dataclass(frozen=True)
class ModelPair:
    """Difference of two cells of a margin, or of two slopes; corrected for the pairs of the margin.

    `p_equivalence` is that of two one-sided tests, of cells alone; None without bounds.
    """

    margin: str
    first: dict[str, str]
    second: dict[str, str]
    difference: float
    se: float
    df: float
    t: float
    p_value: float
    p_bonferroni: float
    p_holm: float
    p_tukey: float
    ci: tuple[float, float]
    p_equivalence: float | None = None


@dataclass(frozen=True)
class ModelTrend:
    """Change of the rating per unit of a covariate, at levels of the factors that it interacts with."""

    covariate: str
    levels: dict[str, str]
    estimate: float
    se: float
    df: float
    t: float
    p_value: float
    ci: tuple[float, float]


@dataclass(frozen=True)
class RatioTest:
    """Likelihood-ratio test of a fixed effect: maximum likelihood with and without its columns."""

    effect: str
    chi2: float
    df: int
    p_value: float


@dataclass(frozen=True)
class ModelMeans:
    """Means of each factor and of each two, pairs of these, trends and the pairs of trends."""

    means: tuple[ModelMean, ...]
    pairs: tuple[ModelPair, ...]
    trends: tuple[ModelTrend, ...]
    trend_pairs: tuple[ModelPair, ...]


def model_means(
    data: ModelData, estimated: Callable[[Floats], Estimate], bounds: tuple[float, float] | None = None
) -> ModelMeans:
    """Means, pairs and trends of a fitted model.

    Parameters
    ----------
    data : ModelData
    estimated : callable
        Takes a contrast of the columns of `data.x` (f,), whose first is the intercept.
    bounds : tuple of float, optional
        Of equivalence of two cells.
    """
    means: list[ModelMean] = []
    pairs: list[ModelPair] = []
    trends: list[ModelTrend] = []
    trend_pairs: list[ModelPair] = []
    for margin in (m for size in (1, 2) for m in combinations(data.factors, size)):
        name = ":".join(margin)
        cells = list(_cells_of(data, margin))
        for levels, row in cells:
            value, se, df = estimated(row)
            means.append(ModelMean(name, levels, value, se, df, _interval(value, se, df)))
        pairs += _pairs(name, cells, estimated, bounds)
    for effect in data.number_effects:
        # Interactions with factors are in the trends at their levels; products of covariates have no slope.
        if len(effect.covariates) > 1 or effect.factors:
            continue
        with_factors = [e.factors for e in data.number_effects if e.covariates == effect.covariates]
        own = tuple(f for f in data.factors if any(f in factors for factors in with_factors))
        slopes = [(levels, _trend_row(data, effect.name, row)) for levels, row in _cells_of(data, own)]
        for levels, row in slopes:
            value, se, df = estimated(row)
            t, p = _t_test(value, se, df)
            trends.append(ModelTrend(effect.name, levels, value, se, df, t, p, _interval(value, se, df)))
        trend_pairs += _pairs(effect.name, slopes, estimated)
    return ModelMeans(tuple(means), tuple(pairs), tuple(trends), tuple(trend_pairs))


def ratio_tests(data: ModelData, chi2_without: Callable[[NDArray[np.int64]], float]) -> tuple[RatioTest, ...]:
    """A test of each effect; `chi2_without` takes the columns that the smaller model lacks."""
    tests = []
    for effect in data.effects:
        columns = data.columns(effect)
        # Two searches end within their tolerance: the difference may come out slightly below zero.
        chi2 = max(0.0, chi2_without(columns))
        tests.append(RatioTest(effect, chi2, len(columns), float(stats.chi2.sf(chi2, len(columns)))))
    return tuple(tests)


def _cells_of(data: ModelData, margin: Sequence[str]) -> Iterator[tuple[dict[str, str], Floats]]:
    """Each cell of a margin with its contrast (f,), at the mean of every covariate."""
    sizes = {factor: len(names) for factor, names in zip(data.factors, data.levels, strict=True)}
    width = data.x.shape[1]
    for at in product(*(range(sizes[factor]) for factor in margin)):
        weights: Floats = np.ones(1)
        for factor, names in zip(data.factors, data.levels, strict=True):
            # Levels of other factors weigh the same, however many ratings they have.
            inside = np.full(len(names), 1 / len(names))
            if factor in margin:
                inside = np.eye(len(names))[at[margin.index(factor)]]
            weights = np.asarray(np.kron(weights, inside))
        row = np.zeros(width)
        # Columns of covariates stay 0, which is their mean.
        row[: data.fixed.shape[1]] = weights @ data.fixed
        levels = dict(zip(data.factors, data.levels, strict=True))
        yield {factor: levels[factor][k] for factor, k in zip(margin, at, strict=True)}, row


def _trend_row(data: ModelData, covariate: str, cell: Floats) -> Floats:
    """Contrast (f,) of a covariate's slope in a cell, other covariates at their means."""
    row, of = np.zeros(len(cell)), np.array(data.effect_of)
    for effect in data.number_effects:
        if effect.covariates == (covariate,):
            multiplied = np.flatnonzero(of == (":".join(effect.factors) or "intercept"))
            row[data.columns(effect.name)] = cell[multiplied]
    return row


def _pairs(
    margin: str,
    cells: Sequence[tuple[dict[str, str], Floats]],
    estimated: Callable[[Floats], Estimate],
    bounds: tuple[float, float] | None = None,
) -> list[ModelPair]:
    both = list(combinations(cells, 2))
    if not both:
        return []
    each = [estimated(first - second) for (_, first), (_, second) in both]
    tests = [_t_test(*one) for one in each]
    p = np.array([p for _, p in tests])
    corrected = zip(bonferroni(p), holm(p), strict=True)
    pairs = []
    for ((first, _), (second, _)), one, (t, own), (by_bonferroni, by_holm) in zip(
        both, each, tests, corrected, strict=True
    ):
        by_tukey = tukey(np.array([t]), len(cells), one[2])[0]
        all_p = (own, float(by_bonferroni), float(by_holm), float(by_tukey))
        equal = None if bounds is None else equivalence_p(*one, bounds)
        pairs.append(ModelPair(margin, first, second, *one, t, *all_p, _interval(*one), equal))
    return pairs


def _t_test(value: float, se: float, df: float) -> tuple[float, float]:
    t = value / se
    return t, float(2 * stats.t.sf(abs(t), df))


def _interval(value: float, se: float, df: float) -> tuple[float, float]:
    reach = float(stats.t.ppf(0.975, df)) * se
    return value - reach, value + reach
