"""The aligned rank transform: an ANOVA of ranks that is right for interactions too."""

from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np
from numpy.typing import NDArray

from analysis.within.anova import AnovaResult, linear_anova
from experiments.errors import InputError

Floats = NDArray[np.float64]

DIGITS = 9
"""Values that agree to so many digits of the largest are ties: alignment adds rounding noise."""


@dataclass(frozen=True)
class RankTest:
    """Univariate F of one effect on the ranks of data from which all other effects were removed."""

    effect: str
    f_value: float
    df_effect: int
    df_error: int
    p_value: float
    epsilon_gg: float
    p_gg: float


def rank_tests(result: AnovaResult) -> tuple[RankTest, ...]:
    r"""Test every effect of factors on aligned ranks.

    Parameters
    ----------
    result : AnovaResult
        Its cell means y (N, K) are ranked; it has no covariates.

    Returns
    -------
    tuple of RankTest
        In the order of `result.effects`.

    Raises
    ------
    InputError
        A covariate: what is aligned are cells, and a covariate has none.

    Notes
    -----
    For the effect of the factors S, with m the mean of y over participants of a group and
    :math:`m_T` its margin over all factors but T, groups weighing the same:

    1. :math:`e_S = \sum_{T \subseteq S} (-1)^{|S| - |T|} m_T`;
    2. :math:`a = y - m + e_S`, ranked over all participants and cells, ties sharing their mean rank;
    3. the ANOVA of these ranks, of which the effect of S alone is kept.

    Source: Wobbrock, Findlater, Gergle & Higgins (2011), doi:10.1145/1978942.1978963, here on participants'
    cell means.
    """
    if result.between.covariates:
        named = ", ".join(covariate.name for covariate in result.between.covariates)
        raise InputError(f"aligned ranks are for factors alone; leave the covariates out: {named}")
    means = _group_means(result)
    own = means[tuple(result.between.codes.T)] if result.between.factors else means[None]
    tests = []
    for effect in result.effects:
        axes = tuple(result.all_factors.index(name) for name in effect.factors)
        part = _effect_of(means, axes)
        estimate = part[tuple(result.between.codes.T)] if result.between.factors else part[None]
        ranks = _ranks(result.y - own + estimate)
        ranked = linear_anova(ranks, result.factors, result.levels, result.between, result.sum_of_squares)
        test = ranked.effect(effect.effect).univariate
        tests.append(
            RankTest(
                effect.effect,
                test.f_value,
                test.df_effect,
                test.df_error,
                test.p_value,
                test.epsilon_gg,
                test.p_gg,
            )
        )
    return tuple(tests)


def _group_means(result: AnovaResult) -> Floats:
    """Cell means over the participants of each group, one axis a factor: between, then within."""
    if not result.between.factors:
        return np.asarray(result.y.mean(axis=0), dtype=np.float64)
    means = np.zeros((*(len(names) for names in result.between.levels), *result.y.shape[1:]))
    for at in np.ndindex(*means.shape[: len(result.between.factors)]):
        means[at] = result.y[(result.between.codes == at).all(axis=1)].mean(axis=0)
    return means


def _effect_of(means: Floats, axes: tuple[int, ...]) -> Floats:
    """What the factors on `axes` do together beyond their parts (equation 1), in the shape of `means`."""
    effect = np.zeros_like(means)
    for kept in chain.from_iterable(combinations(axes, size) for size in range(len(axes) + 1)):
        others = tuple(axis for axis in range(means.ndim) if axis not in kept)
        effect += (-1) ** (len(axes) - len(kept)) * means.mean(axis=others, keepdims=True)
    return effect


def _ranks(values: Floats) -> Floats:
    largest = float(np.abs(values).max()) or 1.0
    # scipy.stats has this too, and takes longer to import than all tests of a report to compute
    _, position, count = np.unique(
        np.round(values / largest, DIGITS), return_inverse=True, return_counts=True
    )
    mean_rank = np.cumsum(count) - (count - 1) / 2
    return np.asarray(mean_rank[position], dtype=np.float64).reshape(values.shape)
