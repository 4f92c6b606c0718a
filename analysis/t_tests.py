"""t tests of participants' means: Welch and Games-Howell between groups, one sample against a value."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from analysis.within.adjustments import bonferroni, holm, tukey
from analysis.within.contrast_tests import equivalence_p
from analysis.within.pairwise import bayes_factor, size_intervals
from experiments.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GroupMean:
    """A group's participants: number, mean, SD (n - 1) and 95% interval of the mean."""

    name: str
    n: int
    mean: float
    sd: float
    ci: tuple[float, float]


@dataclass(frozen=True)
class WelchAnova:
    """Welch's (1951) test that all means are equal; `omega_sq` is df1 (F - 1) / (df1 (F - 1) + N)."""

    f_value: float
    df_effect: int
    df_error: float
    p_value: float
    omega_sq: float


@dataclass(frozen=True)
class MeanTest:
    """A t test of two groups (Welch), or of one group against a value.

    Attributes
    ----------
    first, second : str
        Groups; `second` is the value of a one-sample test.
    difference, se, t, df, p_value : float
        `first` minus `second`; variances are not pooled.
    ci : (float, float)
        95% interval of the difference.
    d, d_ci : float, (float, float)
        Cohen's d: over the pooled SD of the two groups, or the SD of the one; interval from the noncentral t.
    d_ci_approximate : (float, float)
        What many papers print (R's effsize): t times the large-sample error of d; of one sample 1.96 times
        1 / sqrt(n), which leaves out the error of the SD.
    bayes_factor : float
        BF10 with Jeffreys, Zellner and Siow's prior, r = sqrt(2) / 2; of two groups it pools variances.
    p_holm, p_bonferroni : float
        Corrected over all tests of the table.
    p_games_howell : float or None
        Of two groups.
    p_equivalence : float or None
        The greater of two one-sided p values against the bounds (TOST), where bounds are given.
    """

    first: str
    second: str
    difference: float
    se: float
    t: float
    df: float
    p_value: float
    ci: tuple[float, float]
    d: float
    d_ci: tuple[float, float]
    d_ci_approximate: tuple[float, float]
    bayes_factor: float
    p_holm: float
    p_bonferroni: float
    p_games_howell: float | None = None
    p_equivalence: float | None = None


@dataclass(frozen=True)
class MeansAnalysis:
    """Everything `analysis t-test` knows of a table."""

    factor: str | None
    groups: tuple[GroupMean, ...]
    welch: WelchAnova | None
    tests: tuple[MeanTest, ...]
    against: float | None = None
    equivalence_bounds: tuple[float, float] | None = None
    decisions: tuple[str, ...] = field(default=())


def compare_groups(
    factor: str,
    names: Sequence[str],
    groups: Sequence[Floats],
    bounds: tuple[float, float] | None = None,
) -> MeansAnalysis:
    """Welch's ANOVA, and Welch's t test of each pair with Games and Howell's p.

    Parameters
    ----------
    factor : str
    names : sequence of str
    groups : sequence of ndarray
        One mean per participant of each group.
    bounds : (float, float), optional
        Bounds of equivalence.

    Raises
    ------
    InputError
        Fewer than two groups, a group of one participant, or a pair of groups without any variance.
    """
    if len(groups) < 2:
        raise InputError(f"'{factor}' has one level, {names[0]}; to test it against a value, add --against 4")
    for name, group in zip(names, groups, strict=True):
        if len(group) < 2:
            raise InputError(
                f"{factor}={name} has one participant, and no variance; remove it, or collect more"
            )
    pairs = list(combinations(range(len(groups)), 2))
    rows = [_unequal(names[a], names[b], groups[a], groups[b]) for a, b in pairs]
    # The studentized range of as many groups, with the df of each pair.
    games = [float(tukey(np.array([row.t]), len(groups), row.df)[0]) for row in rows]
    tests = _corrected(rows, bounds, games)
    return MeansAnalysis(
        factor, _described(names, groups), _welch_anova(groups), tests, equivalence_bounds=bounds
    )


def compare_with_value(
    factor: str | None,
    names: Sequence[str],
    groups: Sequence[Floats],
    value: float,
    bounds: tuple[float, float] | None = None,
) -> MeansAnalysis:
    """One-sample t tests of each group (or level) against a value.

    Raises
    ------
    InputError
        A group of one participant, or without any variance.
    """
    rows = []
    for name, group in zip(names, groups, strict=True):
        where = name if factor is None else f"{factor}={name}"
        # Equal values give a standard error of 0, hence no t.
        if len(group) < 2 or np.ptp(group) == 0:
            raise InputError(
                f"{where}: expected means of two participants or more that differ, got "
                f"{'one' if len(group) < 2 else f'{len(group)} times {group[0]:g}'}; there is no t test"
            )
        n, sd = len(group), float(group.std(ddof=1))
        difference, se = float(group.mean()) - value, sd / n**0.5
        # The size of one sample: t and d differ by the root of n. The approximate interval is that of a mean.
        size = _Size(difference / se, n**-0.5, n - 1, n, float(stats.norm.ppf(0.975)) * n**-0.5)
        rows.append(_tested(name, f"{value:g}", difference, se, n - 1, size))
    tests = _corrected(rows, bounds, [None] * len(rows))
    return MeansAnalysis(factor, _described(names, groups), None, tests, value, bounds)


def _unequal(first: str, second: str, a: Floats, b: Floats) -> MeanTest:
    n = np.array([len(a), len(b)])
    variances = np.array([a.var(ddof=1), b.var(ddof=1)])
    # One group may be constant; the other still gives a standard error.
    if not variances.any():
        raise InputError(f"neither {first} nor {second} varies between participants; there is no t test")
    errors = variances / n
    difference, se = float(a.mean() - b.mean()), float(errors.sum() ** 0.5)
    # Welch and Satterthwaite's degrees of freedom.
    df = float(errors.sum() ** 2 / (errors**2 / (n - 1)).sum())
    # The size pools the variances, which the test does not.
    pooled_df = int(n.sum() - 2)
    pooled = float(((n - 1) * variances).sum() / pooled_df) ** 0.5
    scale, d = float((1 / n).sum()) ** 0.5, difference / pooled
    # The large-sample error of d, as R's effsize computes it.
    error = ((scale**2 + d**2 / pooled_df / 2) * float(n.sum()) / pooled_df) ** 0.5
    approximate = float(stats.t.ppf(0.975, pooled_df)) * error
    # n1 n2 / (n1 + n2) takes the place of n in the Bayes factor of two groups.
    size = _Size(d / scale, scale, pooled_df, scale**-2, approximate)
    return _tested(first, second, difference, se, df, size)


@dataclass(frozen=True)
class _Size:
    """What an effect size rests on: t, d over t, their df and n, and half the approximate interval of d."""

    t: float
    scale: float
    df: int
    n: float
    reach: float


def _tested(first: str, second: str, difference: float, se: float, df: float, size: _Size) -> MeanTest:
    reach = float(stats.t.ppf(0.975, df)) * se
    low, high = size_intervals(np.array([size.t]), np.array([size.scale]), size.df, 0.95)[0]
    d = size.t * size.scale
    return MeanTest(
        first,
        second,
        difference,
        se,
        difference / se,
        df,
        # The lower tail twice: 1 minus a distribution function loses small p.
        float(2 * special.stdtr(df, -abs(difference / se))),
        (difference - reach, difference + reach),
        d,
        (float(low), float(high)),
        (d - size.reach, d + size.reach),
        bayes_factor(size.t, size.n, size.df),
        # Both corrections need all tests of the table; `_corrected` fills them in.
        np.nan,
        np.nan,
    )


def _corrected(
    rows: Sequence[MeanTest], bounds: tuple[float, float] | None, games: Sequence[float | None]
) -> tuple[MeanTest, ...]:
    p = np.array([row.p_value for row in rows])
    return tuple(
        MeanTest(
            **{
                **vars(row),
                "p_holm": float(by_holm),
                "p_bonferroni": float(by_bonferroni),
                "p_games_howell": game,
                # Not corrected: equivalence is tested for each difference by itself.
                "p_equivalence": None
                if bounds is None
                else equivalence_p(row.difference, row.se, row.df, bounds),
            }
        )
        for row, by_holm, by_bonferroni, game in zip(rows, holm(p), bonferroni(p), games, strict=True)
    )


def _described(names: Sequence[str], groups: Sequence[Floats]) -> tuple[GroupMean, ...]:
    described = []
    for name, group in zip(names, groups, strict=True):
        n, mean, sd = len(group), float(group.mean()), float(group.std(ddof=1))
        # Each group by its own SD: variances are not assumed to be equal.
        reach = float(stats.t.ppf(0.975, n - 1)) * sd / n**0.5
        described.append(GroupMean(name, n, mean, sd, (mean - reach, mean + reach)))
    return tuple(described)


def _welch_anova(groups: Sequence[Floats]) -> WelchAnova | None:
    """None where a group does not vary: its weight would have no limit."""
    n = np.array([len(group) for group in groups])
    variances = np.array([group.var(ddof=1) for group in groups])
    if not variances.all():
        return None
    means, weights, k = np.array([group.mean() for group in groups]), n / variances, len(groups)
    centre = (weights * means).sum() / weights.sum()
    # Welch (1951): how uncertain the weights are, which are estimated variances.
    spread = ((1 - weights / weights.sum()) ** 2 / (n - 1)).sum() / (k**2 - 1)
    f = float((weights * (means - centre) ** 2).sum() / (k - 1) / (1 + 2 * (k - 2) * spread))
    # Estimated from the data, so rarely a whole number.
    df_error = float(1 / (3 * spread))
    # Negative below F = 1, as omega squared may be.
    size = (k - 1) * (f - 1) / ((k - 1) * (f - 1) + float(n.sum()))
    return WelchAnova(f, k - 1, df_error, float(stats.f.sf(f, k - 1, df_error)), size)
