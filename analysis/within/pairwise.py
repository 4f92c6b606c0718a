"""Paired comparisons of the levels of a margin, with Bonferroni and Holm adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult
from analysis.within.contrasts import effect_name
from analysis.within.marginal_means import level_combinations, margin
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Paired t test of two levels of a margin, on participants' marginal means, N - 1 df, never pooled.

    `difference` is level_a minus level_b; `t`, `p` and `dz` are NaN where the difference does not vary.
    Levels of a margin of several factors are joined with ':'.
    """

    effect: str
    level_a: str
    level_b: str
    difference: float
    se: float
    t: float
    df: int
    p: float
    p_bonferroni: float
    p_holm: float
    ci: tuple[float, float]
    dz: float


def adjust(p: Floats) -> tuple[Floats, Floats]:
    """Bonferroni and Holm adjusted p values (m,); NaN stays NaN and counts in m."""
    m, order = p.size, np.argsort(p, kind="stable")
    holm = np.empty_like(p)
    stepped = np.maximum.accumulate((m - np.arange(m)) * p[order])
    holm[order] = np.minimum(1.0, stepped)
    return np.minimum(1.0, m * p), np.where(np.isnan(p), np.nan, holm)


def pairs_of(result: AnovaResult, factors: Sequence[str], confidence: float = 0.95) -> tuple[Pair, ...]:
    """All pairs of levels of the margin of `factors` (names, any order)."""
    for name in factors:
        if name not in result.factors:
            raise InputError(f"no factor is called '{name}'{did_you_mean(name, result.factors)}")
    members = tuple(sorted(result.factors.index(name) for name in set(factors)))
    values = margin(result, members)
    names = [":".join(levels.values()) for levels in level_combinations(result, members)]
    first, second = (np.array(side) for side in zip(*combinations(range(len(names)), 2), strict=True))
    differences = values[:, first] - values[:, second]
    effect = effect_name([result.factors[m] for m in members])
    labels = [(names[a], names[b]) for a, b in zip(first, second, strict=True)]
    return _tested(effect, labels, differences, float(np.abs(values).max()), confidence)


def one_factor_pairs(result: AnovaResult, confidence: float = 0.95) -> tuple[Pair, ...]:
    """Pairs of every margin of one factor; the adjustments count the pairs of that margin."""
    return tuple(pair for name in result.factors for pair in pairs_of(result, [name], confidence))


def _tested(
    effect: str, labels: list[tuple[str, str]], differences: Floats, scale: float, confidence: float
) -> tuple[Pair, ...]:
    n = len(differences)
    mean, spread = differences.mean(axis=0), differences.std(axis=0, ddof=1)
    spread = np.where(spread > 16 * np.finfo(float).eps * scale, spread, 0.0)
    se = spread / np.sqrt(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(spread > 0, mean / se, np.nan)
        dz = np.where(spread > 0, mean / spread, np.nan)
    p = 2 * special.stdtr(n - 1, -np.abs(t))
    bonferroni, holm = adjust(p)
    reach = float(special.stdtrit(n - 1, 0.5 + confidence / 2)) * se
    return tuple(
        Pair(
            effect=effect,
            level_a=a,
            level_b=b,
            difference=float(mean[i]),
            se=float(se[i]),
            t=float(t[i]),
            df=n - 1,
            p=float(p[i]),
            p_bonferroni=float(bonferroni[i]),
            p_holm=float(holm[i]),
            ci=(float(mean[i] - reach[i]), float(mean[i] + reach[i])),
            dz=float(dz[i]),
        )
        for i, (a, b) in enumerate(labels)
    )
