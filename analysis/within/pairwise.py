"""Paired comparisons of the levels of a margin, adjusted by Bonferroni and Holm, with their Bayes factors."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.adjustments import bonferroni, false_discovery_rate, holm, sidak, tukey
from analysis.within.anova import AnovaResult
from analysis.within.estimates import Margin, margin_of
from analysis.within.strata import effect_name

# Bayes factors of t tests with Jeffreys, Zellner and Siow's prior.

PRIOR_SCALE = 2**0.5 / 2
"""Scale r of the Cauchy prior on effect sizes."""

_LOG_Z = np.arange(-45.0, 2.6, 0.02)
"""Where the integral is summed; the normal density is below 1e-40 beyond."""


def bayes_factor(t: float, n: float, df: float, scale: float = PRIOR_SCALE) -> float:
    r"""How much better a difference predicts t than none does.

    Parameters
    ----------
    t : float
        Of a test of one sample of differences, or of two groups.
    n : float
        Differences; of two groups n1 n2 / (n1 + n2).
    df : float
        Of t.
    scale : float
        r, of the Cauchy prior on the effect in standard deviations.

    Returns
    -------
    float
        BF10; NaN where t or n is.

    Notes
    -----
    Rouder et al. (2009), equation 1, doi:10.3758/PBR.16.2.225:

    .. math:: BF_{10} = \frac{\int_0^\infty (1 + n g r^2)^{-1/2}
        \left(1 + \frac{t^2}{\nu (1 + n g r^2)}\right)^{-(\nu + 1) / 2} p(g) \, dg}
        {(1 + t^2 / \nu)^{-(\nu + 1) / 2}}

    g is 1 over a chi-squared variate on one df, so that with :math:`g = z^{-2}` its density is that of a
    normal z, twice; summed over equal steps of log z, which converges exponentially. pingouin gives the same
    by scipy's `quad`; importing it takes as long as the rest of a report.
    """
    if not (np.isfinite(t) and np.isfinite(n)):
        return float("nan")
    # g = 1 / z^2, so that the prior is a normal density in z.
    z2 = np.exp(2 * _LOG_Z)
    # log(1 + n r^2 / z^2), and what t says of each g against what it says of no difference
    inflation = np.log1p(n * scale**2 / z2)
    odds = (df + 1) / 2 * (np.log1p(t**2 / df) - np.log1p(t**2 / df * np.exp(-inflation)))
    log_terms = odds - inflation / 2 - z2 / 2 + _LOG_Z + np.log(2 * 0.02 / np.sqrt(2 * np.pi))
    # Taken out before exp: for a large t the terms alone would pass the largest float.
    largest = float(log_terms.max())
    with np.errstate(over="ignore"):
        return float(np.exp(largest) * np.exp(log_terms - largest).sum())


Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """t test of two levels of a margin on N - p error df; within participants it is the paired t test.

    `difference` is level_a minus level_b; `t`, `p` and `dz` are NaN where the difference does not vary.
    Adjusted for the pairs of the margin: Bonferroni, Holm, Sidak, Tukey, false discovery rate.
    `dz` divides by the SD of the difference, pooled over groups; between groups it is Cohen's d, over the
    pooled SD of participants' means, and NaN where both group and level differ, as `bayes_factor` (JZS) is.
    `cell_a` and `cell_b` name each factor's level; `level_a` and `level_b` are the same as text: the level,
    or several joined by ':', with the names of their factors where a level holds a ':' itself.
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
    p_sidak: float
    p_tukey: float
    p_fdr: float
    ci: tuple[float, float]
    dz: float
    dz_ci: tuple[float, float]
    bayes_factor: float
    cell_a: dict[str, str]
    cell_b: dict[str, str]


def pairs_of(result: AnovaResult, factors: Sequence[str], confidence: float = 0.95) -> tuple[Pair, ...]:
    """All pairs of levels of the margin of `factors` (names, any order)."""
    margin = margin_of(result, factors)
    cells = margin.combinations
    # Levels may hold a ':' themselves; the texts stay different all the same.
    names = cell_texts(cells)
    pairs = list(combinations(range(len(names)), 2))
    weights = np.zeros((len(pairs), len(names)))
    for row, (a, b) in enumerate(pairs):
        # One contrast per pair: all pairs are then estimated by one product of matrices.
        weights[row, a], weights[row, b] = 1.0, -1.0
    labels = [((names[a], cells[a]), (names[b], cells[b])) for a, b in pairs]
    scale = float(np.abs(result.y).max())
    return _tested(effect_name(margin.names), labels, margin, weights, scale, confidence)


def cell_texts(cells: Sequence[dict[str, str]]) -> list[str]:
    """A text for each cell of a margin, all different: levels joined by ':' where none holds one."""
    if len(cells[0]) == 1:
        return [level for cell in cells for level in cell.values()]
    if not any(":" in level for cell in cells for level in cell.values()):
        return [":".join(cell.values()) for cell in cells]
    return [", ".join(f"{factor}={quote_level(level)}" for factor, level in cell.items()) for cell in cells]


def quote_level(level: str) -> str:
    """A level as text that no separator cuts: in quotation marks where it holds one."""
    return json.dumps(level, ensure_ascii=False) if re.search(r'[,="]', level) else level


def one_factor_pairs(result: AnovaResult, confidence: float = 0.95) -> tuple[Pair, ...]:
    """Pairs of every margin of one factor; the adjustments count the pairs of that margin."""
    return tuple(pair for name in result.all_factors for pair in pairs_of(result, [name], confidence))


def _tested(
    effect: str,
    labels: list[tuple[tuple[str, dict[str, str]], tuple[str, dict[str, str]]]],
    margin: Margin,
    weights: Floats,
    scale: float,
    confidence: float,
) -> tuple[Pair, ...]:
    estimate, se, t = margin.tested(weights, scale)
    spread = _spread(margin, weights)
    with np.errstate(divide="ignore", invalid="ignore"):
        size, scale_of_t = (np.where(se > 0, values / spread, np.nan) for values in (estimate, se))
    # The lower tail of -|t|: 1 - cdf would round the p of a large t to 0.
    p = 2 * special.stdtr(margin.df, -np.abs(t))
    family = [bonferroni(p), holm(p), sidak(p), tukey(t, len(margin.combinations), margin.df)]
    # A pair that does not vary has no p value, adjusted or not.
    family = [np.where(np.isnan(p), np.nan, values) for values in (*family, false_discovery_rate(p))]
    sizes = size_intervals(t, scale_of_t, margin.df, confidence)
    reach = float(special.stdtrit(margin.df, 0.5 + confidence / 2)) * se
    return tuple(
        Pair(
            effect=effect,
            level_a=a[0],
            level_b=b[0],
            difference=float(estimate[i]),
            se=float(se[i]),
            t=float(t[i]),
            df=margin.df,
            p=float(p[i]),
            p_bonferroni=float(family[0][i]),
            p_holm=float(family[1][i]),
            p_sidak=float(family[2][i]),
            p_tukey=float(family[3][i]),
            p_fdr=float(family[4][i]),
            ci=(float(estimate[i] - reach[i]), float(estimate[i] + reach[i])),
            dz=float(size[i]),
            dz_ci=(float(sizes[i, 0]), float(sizes[i, 1])),
            # as many differences of this SD have this standard error: N, or n1 n2 / (n1 + n2) of two groups
            bayes_factor=bayes_factor(float(t[i]), float(scale_of_t[i]) ** -2.0, margin.df),
            cell_a=a[1],
            cell_b=b[1],
        )
        for i, (a, b) in enumerate(labels)
    )


def size_intervals(t: Floats, scale: Floats, df: int, confidence: float) -> Floats:
    """Intervals (m, 2) of standardized differences from the noncentral t distribution.

    The noncentralities that put t at the two tails, times `scale`, which is the size over t.
    Source: Steiger & Fouladi (1997).
    """
    tails = np.array([0.5 + confidence / 2, 0.5 - confidence / 2])
    with np.errstate(invalid="ignore"):
        # The t of a pair that does not vary is NaN, of which scipy warns; its size becomes NaN below.
        noncentral = special.nctdtrinc(float(df), tails, np.where(np.isnan(t), 0.0, t)[:, None])
        return np.asarray(noncentral * scale[:, None], dtype=np.float64)


def _spread(margin: Margin, weights: Floats) -> Floats:
    """What differences are divided by: SD of the difference, or of participants' means between groups.

    A difference of cells that differ in group and in level has neither: NaN.
    """
    # Weights of groups x levels: those within a group sum to 0 over levels, those between over groups.
    groups = weights.reshape(len(weights), len(margin.rows), -1)
    inside = (groups.sum(axis=2) == 0).all(axis=1)
    across = (groups.sum(axis=1) == 0).all(axis=1)
    scale = np.where(inside[:, None, None], 1.0, 0.5) * np.abs(groups).sum(axis=1, keepdims=True)
    signed = np.where(inside[:, None], groups.sum(axis=1), scale[:, 0])
    spread = np.sqrt(((margin.residual @ signed.T) ** 2).sum(axis=0) / margin.df)
    return np.where(inside | across, spread, np.nan)
