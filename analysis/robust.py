"""Companions of the ANOVA that assume less: aligned ranks, permutations, trimmed means."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, islice, permutations, product
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.adjustments import holm
from analysis.within.anova import AnovaResult, linear_anova
from analysis.within.between import reduced_columns, term_directions
from analysis.within.strata import contrast_scores
from experiments.errors import InputError

# Permutation tests of every effect of an ANOVA: Freedman and Lane's, with sign flips within participants.

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

N_RANDOM = 9_999
"""Random rearrangements where there are more than that; p is then known to about 0.004 at .05."""
CHUNK = 500
"""Rearrangements computed at a time, which bounds the memory."""
TIE = 1e-9
"""Relative difference below which two F count as equal."""


@dataclass(frozen=True)
class PermutationTest:
    """One effect's univariate F held against the F of rearranged data.

    `p_value` is NaN where the error is zero. `exact` is true if every rearrangement was tried; otherwise
    `n_rearranged` of them were drawn and p = (1 + those at least as large) / (1 + n_rearranged).
    """

    effect: str
    f_value: float
    p_value: float
    n_rearranged: int
    exact: bool
    flips: bool


def permutation_tests(
    result: AnovaResult, n_random: int = N_RANDOM, seed: int = 1
) -> tuple[PermutationTest, ...]:
    r"""Test every effect by rearranging participants' residuals under the model without it.

    Parameters
    ----------
    result : AnovaResult
    n_random : int
        Rearrangements drawn where there are more than these in all; otherwise each is tried once.
    seed : int
        Of the draws; the same seed gives the same p.

    Returns
    -------
    tuple of PermutationTest
        In the order of `result.effects`.

    Notes
    -----
    With z (N, q) the scores of the effect's within contrasts, Z the columns of the design between
    participants without the effect's term, U (r, N) that term's directions, Q an orthonormal basis of the
    whole design (N, p):

    1. :math:`e = (I - Z Z^+) z`;
    2. for each rearrangement :math:`\pi`: :math:`h = \lVert U \pi e \rVert^2`,
       :math:`s = \lVert e \rVert^2 - \lVert Q' \pi e \rVert^2`,
       :math:`F^* = (h / r q) / (s / q (N - p))`.

    A term of groups or covariates permutes participants; an effect within participants alone has none to
    permute and flips the sign of whole participants, which is right where errors are symmetric. A
    participant's scores stay together, so that sphericity is not assumed.

    Sources: Freedman & Lane (1983), doi:10.1080/07350015.1983.10509354; Winkler et al. (2014),
    doi:10.1016/j.neuroimage.2014.01.060, for the flips.
    """
    scores, columns = contrast_scores(result.y)
    design = result.between
    basis = design.basis
    directions = dict(zip(design.terms, term_directions(design, result.sum_of_squares), strict=True))
    tests = []
    for effect in result.effects:
        members = tuple(result.factors.index(name) for name in effect.within)
        others = design.matrix[:, reduced_columns(design, effect.between, result.sum_of_squares)]
        z = scores[:, columns[members]]
        # Freedman and Lane's: what the other terms explain is taken out before, and only errors are
        # rearranged.
        residual = z - others @ np.linalg.lstsq(others, z, rcond=None)[0] if others.size else z
        flips = not effect.between
        f_value = effect.univariate.f_value
        if not np.isfinite(f_value):
            tests.append(PermutationTest(effect.effect, f_value, float("nan"), 0, False, flips))
            continue
        # One generator per effect: its p must not change with the other tested effects.
        draws, total, exact = _rearrangements(len(z), flips, n_random, np.random.default_rng(seed))
        # The observed data are one of the rearrangements, and are compared by the same statistic to the
        # last digit.
        ratio = _ratio(residual[None], directions[effect.between], basis)[0]
        larger = sum(
            int((_ratio(rearranged, directions[effect.between], basis) >= ratio * (1 - TIE)).sum())
            for rearranged in _applied(residual, draws, flips)
        )
        p = larger / total if exact else (1 + larger) / (1 + total)
        tests.append(PermutationTest(effect.effect, f_value, p, total, exact, flips))
    return tuple(tests)


def _ratio(scores: Floats, directions: Floats, basis: Floats) -> Floats:
    """Sum of squares of the term over the error, (B,), of scores (B, N, q); F but for a constant."""
    hypothesis = np.square(directions @ scores).sum(axis=(1, 2))
    # By Pythagoras: the part outside the design is what its orthonormal basis does not hold.
    error = np.square(scores).sum(axis=(1, 2)) - np.square(basis.T @ scores).sum(axis=(1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(hypothesis / np.maximum(error, 0.0), dtype=np.float64)


def _applied(residual: Floats, draws: Iterator[Floats], flips: bool) -> Iterator[Floats]:
    """The residuals rearranged, a chunk (B, N, q) at a time."""
    for drawn in draws:
        # Orders come as floats as well, so that signs and orders have one type.
        yield drawn[:, :, None] * residual if flips else residual[drawn.astype(np.int64)]


def _rearrangements(
    n: int, flips: bool, n_random: int, rng: np.random.Generator
) -> tuple[Iterator[Floats], int, bool]:
    """Chunks (B, n) of signs or orders of n participants: all where they are few; how many; whether all."""
    # Where all can be tried none is drawn: the p is then exact, and the same for every seed.
    every = 2**n if flips else factorial(n)
    # One more, since all of them include the data as they are.
    if every <= n_random + 1:
        orders = product((1.0, -1.0), repeat=n) if flips else permutations(range(n))
        return _chunks(orders), every, True
    sizes = [min(CHUNK, n_random - start) for start in range(0, n_random, CHUNK)]
    if flips:
        return (rng.choice((1.0, -1.0), (size, n)) for size in sizes), n_random, False
    return (
        (rng.permuted(np.tile(np.arange(n, dtype=np.float64), (size, 1)), axis=1) for size in sizes),
        n_random,
        False,
    )


def _chunks(orders: Iterable[tuple[float, ...]]) -> Iterator[Floats]:
    every = iter(orders)
    while chunk := list(islice(every, CHUNK)):
        yield np.array(chunk, dtype=np.float64)


# The aligned rank transform: an ANOVA of ranks that is right for interactions too.

DIGITS = 9
"""Values that agree to this many digits of the largest are ties: alignment adds rounding noise."""


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
        raise InputError(f"aligned ranks are for factors only; remove the covariates: {named}")
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
    """Cell means over the participants of each group, one axis per factor: between, then within."""
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
    # Values that are all zero would divide by zero.
    largest = float(np.abs(values).max()) or 1.0
    # scipy.stats has this too, and takes longer to import than all tests of a report to compute
    _, position, count = np.unique(
        np.round(values / largest, DIGITS), return_inverse=True, return_counts=True
    )
    # Ties share the mean of the ranks that they take up: the last one less half the others.
    mean_rank = np.cumsum(count) - (count - 1) / 2
    return np.asarray(mean_rank[position], dtype=np.float64).reshape(values.shape)


# Pairs of levels by trimmed means: Yuen's tests, dependent within participants, Welch's between groups.

TRIM = 0.2
"""Share of participants left out at each end."""


@dataclass(frozen=True)
class TrimmedPair:
    """Difference of two levels' trimmed means over participants, level_a minus level_b.

    `p_holm` is adjusted for the pairs of the margin. NaN where too few are left or nothing varies.
    """

    effect: str
    level_a: str
    level_b: str
    difference: float
    se: float
    t: float
    df: float
    p: float
    p_holm: float
    ci: tuple[float, float]


def trimmed_pairs(
    result: AnovaResult, trim: float = TRIM, confidence: float = 0.95
) -> tuple[TrimmedPair, ...]:
    r"""Compare all pairs of levels of every factor by trimmed means.

    Parameters
    ----------
    result : AnovaResult
    trim : float
        Share of participants left out at each end, from 0 to below 0.5.
    confidence : float
        Coverage of the intervals.

    Returns
    -------
    tuple of TrimmedPair

    Notes
    -----
    Of n participants :math:`g = \lfloor n \, trim \rfloor` are left out at each end, :math:`h = n - 2 g`
    remain; x and y are their means at the two levels, :math:`s` the covariances of the values with the g
    outermost pulled in to the next (winsorized):

    1. within: :math:`SE^2 = (n - 1)(s_{xx} + s_{yy} - 2 s_{xy}) / (h (h - 1))`, df :math:`h - 1`;
    2. between: :math:`SE^2 = d_x + d_y`, :math:`d = (n - 1) s / (h (h - 1))`, df
       :math:`SE^4 / (d_x^2 / (h_x - 1) + d_y^2 / (h_y - 1))`.

    Groups are pooled where a level within participants is compared. Sources: Yuen (1974),
    doi:10.1093/biomet/61.1.165; Wilcox (2012), *Introduction to Robust Estimation*, 5.3 and 5.9.
    """
    pairs: list[TrimmedPair] = []
    for axis, (name, levels) in enumerate(zip(result.factors, result.levels, strict=True)):
        others = tuple(k + 1 for k in range(len(result.factors)) if k != axis)
        samples = list(result.y.mean(axis=others).T)
        pairs += _compared(name, levels, samples, _dependent, trim, confidence)
    people = result.y.reshape(len(result.y), -1).mean(axis=1)
    for column, (name, levels) in enumerate(zip(result.between.factors, result.between.levels, strict=True)):
        samples = [people[result.between.codes[:, column] == code] for code in range(len(levels))]
        pairs += _compared(name, levels, samples, _independent, trim, confidence)
    return tuple(pairs)


def _dependent(x: Floats, y: Floats, trim: float) -> tuple[float, float, float]:
    """Difference, its standard error and df (equation 1)."""
    n, kept = len(x), _kept(len(x), trim)
    # the variance of the differences is s_xx + s_yy - 2 s_xy without the rounding of that sum
    spread = _above_noise((_winsorised(x, trim) - _winsorised(y, trim)).var(ddof=1), x, y)
    variance = (n - 1) * spread / (kept * (kept - 1)) if kept > 1 else np.nan
    return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), float(np.sqrt(variance)), kept - 1


def _independent(x: Floats, y: Floats, trim: float) -> tuple[float, float, float]:
    """Difference, its standard error and df (equation 2)."""
    kept = np.array([_kept(len(x), trim), _kept(len(y), trim)])
    if (kept < 2).any():
        return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), np.nan, np.nan
    s = np.array([_above_noise(_winsorised(values, trim).var(ddof=1), x, y) for values in (x, y)])
    d = (np.array([len(x), len(y)]) - 1) * s / (kept * (kept - 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        df = d.sum() ** 2 / (d**2 / (kept - 1)).sum()
    return _trimmed_mean(x, trim) - _trimmed_mean(y, trim), float(np.sqrt(d.sum())), float(df)


def _above_noise(variance: float, x: Floats, y: Floats) -> float:
    """The variance, or exactly zero where it is no more than rounding of means."""
    largest = max(float(np.abs(x).max()), float(np.abs(y).max()))
    return variance if variance > (8 * np.finfo(float).eps * largest) ** 2 else 0.0


def _cut(n: int, trim: float) -> int:
    return int(np.floor(trim * n + 1e-9))


def _kept(n: int, trim: float) -> int:
    return n - 2 * _cut(n, trim)


def _trimmed_mean(values: Floats, trim: float) -> float:
    cut = _cut(len(values), trim)
    return float(np.sort(values)[cut : len(values) - cut].mean())


def _winsorised(values: Floats, trim: float) -> Floats:
    cut, ordered = _cut(len(values), trim), np.sort(values)
    return np.clip(values, ordered[cut], ordered[len(values) - cut - 1])


def _compared(
    effect: str,
    levels: Sequence[str],
    samples: Sequence[Floats],
    test: Callable[[Floats, Floats, float], tuple[float, float, float]],
    trim: float,
    confidence: float,
) -> list[TrimmedPair]:
    """Every pair of the levels by `test`, which gives difference, standard error and df."""
    compared = list(combinations(range(len(levels)), 2))
    difference, se, df = np.array([test(samples[a], samples[b], trim) for a, b in compared]).T
    with np.errstate(invalid="ignore", divide="ignore"):
        t = np.where(se > 0, difference / se, np.nan)
    p = 2 * special.stdtr(df, -np.abs(t))
    adjusted = np.where(np.isnan(p), np.nan, holm(p))
    reach = special.stdtrit(df, 0.5 + confidence / 2) * se
    return [
        TrimmedPair(
            effect,
            levels[a],
            levels[b],
            float(difference[i]),
            float(se[i]),
            float(t[i]),
            float(df[i]),
            float(p[i]),
            float(adjusted[i]),
            (float(difference[i] - reach[i]), float(difference[i] + reach[i])),
        )
        for i, (a, b) in enumerate(compared)
    ]


# The robust companions of one ANOVA, together.


@dataclass(frozen=True)
class Companions:
    """Tests in addition to those of the ANOVA; `ranks` is empty where `ranks_reason` says why."""

    permutations: tuple[PermutationTest, ...]
    ranks: tuple[RankTest, ...]
    ranks_reason: str | None
    trimmed: tuple[TrimmedPair, ...]


def companions_of(result: AnovaResult) -> Companions:
    """Compute every robust companion of `result`."""
    try:
        ranks, reason = rank_tests(result), None
    except InputError as error:
        ranks, reason = (), str(error)
    return Companions(permutation_tests(result), ranks, reason, trimmed_pairs(result))
