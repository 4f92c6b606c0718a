"""Permutation tests of every effect of an ANOVA: Freedman and Lane's, with sign flips within participants."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, permutations, product
from math import factorial

import numpy as np
from numpy.typing import NDArray

from analysis.within.anova import AnovaResult
from analysis.within.contrasts import contrast_scores
from analysis.within.directions import reduced_columns, term_directions

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

    `p_value` is NaN where the error is zero. `exact` tells that every rearrangement was tried; otherwise
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
        residual = z - others @ np.linalg.lstsq(others, z, rcond=None)[0] if others.size else z
        flips = not effect.between
        f_value = effect.univariate.f_value
        if not np.isfinite(f_value):
            tests.append(PermutationTest(effect.effect, f_value, float("nan"), 0, False, flips))
            continue
        draws, total, exact = _rearrangements(len(z), flips, n_random, np.random.default_rng(seed))
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
    error = np.square(scores).sum(axis=(1, 2)) - np.square(basis.T @ scores).sum(axis=(1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(hypothesis / np.maximum(error, 0.0), dtype=np.float64)


def _applied(residual: Floats, draws: Iterator[Floats], flips: bool) -> Iterator[Floats]:
    """The residuals rearranged, a chunk (B, N, q) at a time."""
    for drawn in draws:
        yield drawn[:, :, None] * residual if flips else residual[drawn.astype(np.int64)]


def _rearrangements(
    n: int, flips: bool, n_random: int, rng: np.random.Generator
) -> tuple[Iterator[Floats], int, bool]:
    """Chunks (B, n) of signs or orders of n participants: all where they are few; how many; whether all."""
    every = 2**n if flips else factorial(n)
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
