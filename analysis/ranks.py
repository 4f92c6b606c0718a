"""Rank tests of one factor, or against a value."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.within.adjustments import bonferroni, holm
from experiments.errors import InputError

Floats = NDArray[np.float64]
DRAWS = 2000
"""Draws of participants for the interval of an effect size."""
# Fixed, so that a report repeats its intervals.
SEED = 53
Bounds = tuple[float, float] | None
Side = Literal["two-sided", "greater", "less"]
EXACT_MAX = 50
"""Without ties the exact distribution is used below this many participants, as in R."""
DIGITS = 13
"""Significant digits that decide whether values or differences are tied."""


@dataclass(frozen=True)
class RankTest:
    """The test of all levels together.

    Attributes
    ----------
    name : str
        `Friedman` or `Kruskal-Wallis`.
    chi2, df, p_value : float
        The statistic, corrected for ties.
    effect : float
        Kendall's W (Friedman) or epsilon squared, H / (N - 1) (Kruskal-Wallis).
    effect_low, effect_high : float
        95% percentile interval over resampled participants.
    """

    name: Literal["Friedman", "Kruskal-Wallis"]
    chi2: float
    df: int
    p_value: float
    effect: float
    effect_low: float
    effect_high: float


@dataclass(frozen=True)
class RankPair:
    """Two levels compared.

    Attributes
    ----------
    statistic : float
        Wilcoxon's V or Mann-Whitney's U of the first level.
    exact : bool
        Whether p is from the exact distribution; with ties it is the normal approximation with continuity
        correction.
    p_value, p_holm, p_bonferroni : float
        Uncorrected, and corrected over all pairs.
    r : float
        Rank-biserial correlation, positive where the first level is higher.
    r_low, r_high : float
        95% percentile interval over resampled participants.
    dunn_z, dunn_p_holm : float or None
        Dunn's z on the ranks of all levels, and its p; None within participants.
    conover_t, conover_p_holm : float or None
        Conover's t on the ranks of all levels, and its p; None of one sample, and where ranks leave no error.
    p_equivalence : float or None
        The greater of two one-sided p values of the same test against the bounds, where bounds are given.
    """

    first: str
    second: str
    n: int
    statistic: float
    exact: bool
    p_value: float
    p_holm: float
    p_bonferroni: float
    r: float
    r_low: float
    r_high: float
    dunn_z: float | None = None
    dunn_p_holm: float | None = None
    conover_t: float | None = None
    conover_p_holm: float | None = None
    p_equivalence: float | None = None


@dataclass(frozen=True)
class RankAnalysis:
    """Everything `analysis ranks` knows of a table."""

    factor: str | None
    design: Literal["within", "between", "against"]
    levels: tuple[str, ...]
    medians: tuple[float, ...]
    mean_ranks: tuple[float, ...]
    n: tuple[int, ...]
    test: RankTest | None
    pairs: tuple[RankPair, ...]
    equivalence_bounds: Bounds = None
    decisions: tuple[str, ...] = field(default=())


def rank_within(factor: str, levels: Sequence[str], values: Floats, bounds: Bounds = None) -> RankAnalysis:
    """Friedman's test and Wilcoxon's signed-rank test of each pair.

    Parameters
    ----------
    factor : str
    levels : sequence of str
        Names of the columns of `values`.
    values : ndarray
        (participants, levels).
    bounds : (float, float), optional
        Bounds of equivalence of each difference.

    Raises
    ------
    InputError
        Fewer than two levels or participants, or nobody who rates two levels differently.
    """
    people, count = values.shape
    if count < 2 or people < 2:
        raise InputError(f"'{factor}': expected two levels and two participants, got {count} and {people}")
    places = _places(values)
    given, values = values, np.round(values, places)
    # Ranks without any difference divide by 0 in Friedman's test.
    if np.all(values == values[:, :1]):
        raise InputError(f"'{factor}': every participant rates all levels alike; there is nothing to rank")
    # Within each participant, ties as mean ranks.
    ranks = np.apply_along_axis(stats.rankdata, 1, values)
    test = RankTest("Friedman", *_friedman(ranks), *_kendall_w(ranks))
    pairs = [
        _signed_ranks(levels[a], levels[b], given[:, a] - given[:, b], places, bounds)
        for a, b in combinations(range(count), 2)
    ]
    return RankAnalysis(
        factor,
        "within",
        tuple(levels),
        _plain(np.median(values, axis=0)),
        _plain(ranks.mean(axis=0)),
        (people,) * count,
        test,
        _corrected(_with_conover(pairs, _conover_within(ranks))),
        bounds,
    )


def rank_against(
    factor: str | None, levels: Sequence[str], groups: Sequence[Floats], value: float, bounds: Bounds = None
) -> RankAnalysis:
    """Wilcoxon's signed-rank test of each level (or of everybody) against a value.

    Parameters
    ----------
    factor : str or None
    levels : sequence of str
    groups : sequence of ndarray
        One value per participant of each level.
    value : float
    bounds : (float, float), optional

    Raises
    ------
    InputError
        A level at which everybody's value is the one tested against.
    """
    places = _places(np.append(np.concatenate(list(groups)), value))
    for name, group in zip(levels, groups, strict=True):
        if np.all(np.round(group - value, places) == 0):
            raise InputError(f"every value of {name} is {value:g}; there is nothing to rank")
    pairs = [
        _signed_ranks(name, f"{value:g}", group - value, places, bounds)
        for name, group in zip(levels, groups, strict=True)
    ]
    return RankAnalysis(
        factor,
        "against",
        tuple(levels),
        tuple(float(np.median(group)) for group in groups),
        (),
        tuple(len(group) for group in groups),
        None,
        _corrected(pairs),
        bounds,
    )


def rank_between(
    factor: str, levels: Sequence[str], groups: Sequence[Floats], bounds: Bounds = None
) -> RankAnalysis:
    """Kruskal and Wallis's test, Mann and Whitney's test and Dunn's test of each pair.

    Parameters
    ----------
    factor : str
    levels : sequence of str
        Names of the groups.
    groups : sequence of ndarray
        One value per participant of each group.
    bounds : (float, float), optional

    Raises
    ------
    InputError
        Fewer than two groups, an empty group, or values that are all alike.
    """
    if len(groups) < 2 or min(map(len, groups)) < 1:
        raise InputError(f"'{factor}': expected at least two groups with a participant each")
    places = _places(np.concatenate(list(groups)))
    given, groups = groups, [np.round(group, places) for group in groups]
    together = np.concatenate(groups)
    if np.all(together == together[0]):
        raise InputError(f"'{factor}': all values are alike; there is nothing to rank")
    # Over all participants together, which Dunn and Conover need.
    ranks = _split(stats.rankdata(together), [len(group) for group in groups])
    chi2 = float(stats.kruskal(*groups).statistic)
    df = len(groups) - 1
    low, high = _interval(groups, _epsilon)
    test = RankTest("Kruskal-Wallis", chi2, df, float(stats.chi2.sf(chi2, df)), _epsilon(groups), low, high)
    dunn = _dunn(ranks, together)
    p_dunn = holm(np.array([p for _, p in dunn]))
    pairs = []
    for number, (a, b) in enumerate(combinations(range(len(groups)), 2)):
        pair = _rank_sum(levels[a], levels[b], given[a], given[b], places, bounds)
        pairs.append(replace(pair, dunn_z=dunn[number][0], dunn_p_holm=float(p_dunn[number])))
    return RankAnalysis(
        factor,
        "between",
        tuple(levels),
        tuple(float(np.median(group)) for group in groups),
        tuple(float(rank.mean()) for rank in ranks),
        tuple(len(group) for group in groups),
        test,
        _corrected(_with_conover(pairs, _conover_between(ranks, chi2))),
        bounds,
    )


def _friedman(ranks: Floats) -> tuple[float, int, float]:
    # Conover (1999), equation 5.8.5: the form that is corrected for ties.
    people, count = ranks.shape
    deviations = float(((ranks.sum(axis=0) - people * (count + 1) / 2) ** 2).sum())
    ties = float((ranks**2).sum()) - people * count * (count + 1) ** 2 / 4
    chi2 = (count - 1) * deviations / ties
    return chi2, count - 1, float(stats.chi2.sf(chi2, count - 1))


def _kendall_w(ranks: Floats) -> tuple[float, float, float]:
    count = ranks.shape[1]

    def concordance(drawn: Floats) -> float:
        # Nobody in the draw may distinguish two levels: then there is no concordance to speak of.
        if np.all(drawn == drawn[:, :1]):
            return 0.0
        return float(_friedman(drawn)[0] / (len(drawn) * (count - 1)))

    return concordance(ranks), *_interval([ranks], lambda drawn: concordance(drawn[0]))


def _places(values: Floats) -> int:
    # Means of trials carry rounding errors: 13/3 - 4 and 7/3 - 2 are tied, though not to the last bit.
    most = float(np.abs(values).max())
    return DIGITS - int(np.ceil(np.log10(most))) if most > 0 else DIGITS


def _signed_ranks(first: str, second: str, given: Floats, places: int, bounds: Bounds) -> RankPair:
    differences = np.round(given, places)
    changed = differences[differences != 0]
    low, high = _interval([differences], lambda drawn: _signed_biserial(drawn[0]))
    # Shifted by a bound, the same test asks whether differences lie beyond it.
    equal = _equivalent(bounds, lambda bound, side: _wilcoxon(np.round(given - bound, places), side)[0])
    if len(changed) == 0:
        alike = RankPair(first, second, len(differences), 0.0, False, 1.0, 1.0, 1.0, 0.0, low, high)
        return replace(alike, p_equivalence=equal)
    # Zeros are left out, as Wilcoxon does (and R).
    v = float(stats.rankdata(np.abs(changed))[changed > 0].sum())
    p, exact = _wilcoxon(differences)
    return RankPair(
        first,
        second,
        len(differences),
        v,
        exact,
        p,
        # Corrections need all pairs; `_corrected` fills them in.
        np.nan,
        np.nan,
        _signed_biserial(differences),
        low,
        high,
        p_equivalence=equal,
    )


def _wilcoxon(differences: Floats, side: Side = "two-sided") -> tuple[float, bool]:
    """p of the signed-rank test, and whether it is exact."""
    changed = differences[differences != 0]
    if len(changed) == 0:
        # Without any difference there is no rank to sum, and nothing speaks for one.
        return 1.0, False
    # R's rule: exact only without ties and without zero differences.
    untied = len(np.unique(np.abs(changed))) == len(changed)
    exact = untied and len(changed) == len(differences) < EXACT_MAX
    how: Literal["exact", "approx"] = "exact" if exact else "approx"
    done = stats.wilcoxon(changed, correction=not exact, method=how, alternative=side)
    return float(done.pvalue), exact


def _equivalent(bounds: Bounds, one_sided: Callable[[float, Side], float]) -> float | None:
    """Two one-sided tests: above the lower bound, and below the upper one."""
    if bounds is None:
        return None
    # Both must be significant, so that the greater p decides.
    return max(one_sided(bounds[0], "greater"), one_sided(bounds[1], "less"))


def _signed_biserial(differences: Floats) -> float:
    changed = differences[differences != 0]
    if len(changed) == 0:
        return 0.0
    ranks = stats.rankdata(np.abs(changed))
    return float((ranks[changed > 0].sum() - ranks[changed < 0].sum()) / ranks.sum())


def _rank_sum(first: str, second: str, given: Floats, other: Floats, places: int, bounds: Bounds) -> RankPair:
    a, b = np.round(given, places), np.round(other, places)
    statistic, p, exact = _mann_whitney(a, b)
    low, high = _interval([a, b], lambda drawn: _biserial(drawn[0], drawn[1]))
    return RankPair(
        first,
        second,
        len(a) + len(b),
        statistic,
        exact,
        p,
        np.nan,
        np.nan,
        _biserial(a, b),
        low,
        high,
        # Rounded after the shift, which brings new rounding errors.
        p_equivalence=_equivalent(
            bounds, lambda bound, side: _mann_whitney(np.round(given - bound, places), b, side)[1]
        ),
    )


def _mann_whitney(a: Floats, b: Floats, side: Side = "two-sided") -> tuple[float, float, bool]:
    """U of the first group, its p, and whether that is exact."""
    tied = len(np.unique(np.concatenate([a, b]))) < len(a) + len(b)
    exact = not tied and len(a) < EXACT_MAX and len(b) < EXACT_MAX
    done = stats.mannwhitneyu(a, b, method="exact" if exact else "asymptotic", alternative=side)
    return float(done.statistic), float(done.pvalue), exact


def _biserial(a: Floats, b: Floats) -> float:
    # Equal to 2 U / (n m) - 1: a tie counts half in U, and 0 here.
    higher = np.sign(a[:, None] - b[None, :])
    return float(higher.mean())


def _epsilon(groups: Sequence[Floats]) -> float:
    # H / (N - 1) is the share of the ranks' variance that the groups explain, with ties too.
    ranks = stats.rankdata(np.concatenate(list(groups)))
    total = float(((ranks - ranks.mean()) ** 2).sum())
    between = sum(
        len(own) * (own.mean() - ranks.mean()) ** 2 for own in _split(ranks, list(map(len, groups)))
    )
    return float(between) / total if total else 0.0


def _dunn(ranks: Sequence[Floats], together: Floats) -> list[tuple[float, float]]:
    # Dunn (1964), equation 1, with the correction for ties.
    total = len(together)
    _, sizes = np.unique(together, return_counts=True)
    ties = float((sizes**3 - sizes).sum()) / (12 * (total - 1))
    spread = total * (total + 1) / 12 - ties
    tested = []
    for a, b in combinations(range(len(ranks)), 2):
        error = np.sqrt(spread * (1 / len(ranks[a]) + 1 / len(ranks[b])))
        z = float((ranks[a].mean() - ranks[b].mean()) / error)
        tested.append((z, 2 * float(stats.norm.sf(abs(z)))))
    return tested


Conover = tuple[list[float], int] | None
"""t of each pair and their df; None where the ranks leave no error."""


def _conover_within(ranks: Floats) -> Conover:
    # Conover (1999), equation 5.8.10: sums of ranks, and the part of the ranks' squares that levels leave.
    people, count = ranks.shape
    sums, df = ranks.sum(axis=0), (people - 1) * (count - 1)
    error = 2 * (people * float((ranks**2).sum()) - float((sums**2).sum())) / df
    # All rank alike: every difference of ranks would be infinitely sure.
    if error <= 1e-9:
        return None
    return [float(sums[a] - sums[b]) / error**0.5 for a, b in combinations(range(count), 2)], df


def _conover_between(ranks: Sequence[Floats], chi2: float) -> Conover:
    # Conover and Iman (1979): Dunn's error, less the part of the ranks' variance that the groups explain.
    every, count = np.concatenate(list(ranks)), len(ranks)
    df = len(every) - count
    # At least 1 df, as the check below comes after the division.
    left = float(every.var(ddof=1)) * (len(every) - 1 - chi2) / max(df, 1)
    if df < 1 or left <= 1e-9:
        return None
    pairs = [(ranks[a], ranks[b]) for a, b in combinations(range(count), 2)]
    return [float((a.mean() - b.mean()) / (left * (1 / len(a) + 1 / len(b))) ** 0.5) for a, b in pairs], df


def _with_conover(pairs: Sequence[RankPair], conover: Conover) -> list[RankPair]:
    if conover is None:
        return list(pairs)
    t, df = conover
    p = holm(2 * stats.t.sf(np.abs(t), df))
    return [
        replace(pair, conover_t=one, conover_p_holm=float(by_holm))
        for pair, one, by_holm in zip(pairs, t, p, strict=True)
    ]


def _interval(groups: Sequence[Floats], size: Callable[[list[Floats]], float]) -> tuple[float, float]:
    # Participants are the rows of a group, so the same draw serves values, differences and rows of ranks.
    random = np.random.default_rng(SEED)
    draws = [size([random.choice(group, len(group)) for group in groups]) for _ in range(DRAWS)]
    # Percentiles: effect sizes are bounded, and their draws skewed.
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def _split(values: Floats, sizes: Sequence[int]) -> list[Floats]:
    return np.split(values, np.cumsum(sizes)[:-1])


def _plain(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _corrected(pairs: Sequence[RankPair]) -> tuple[RankPair, ...]:
    p = np.array([pair.p_value for pair in pairs])
    return tuple(
        replace(pair, p_holm=float(by_holm), p_bonferroni=float(by_bonferroni))
        for pair, by_holm, by_bonferroni in zip(pairs, holm(p), bonferroni(p), strict=True)
    )
