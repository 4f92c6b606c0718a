"""Whether preferences form an order: triples of items, and circles within a rater."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from analysis.pairs.comparisons import LEFT, TIE, Comparisons


@dataclass(frozen=True)
class Transitivity:
    """Triples of items a, b, c with P(a over b) >= .5 and P(b over c) >= .5, all three compared.

    Weak transitivity asks P(a over c) >= .5, moderate >= the smaller, strong >= the greater of the two
    (Coombs 1964).

    Attributes
    ----------
    circular_triads : int
        Circles a > b > c > a within raters who judged every pair once without a tie (Kendall & Babington
        Smith 1940, Biometrika 31, 324), with the most that could be.
    """

    triples: int
    weak_violations: int
    moderate_violations: int
    strong_violations: int
    raters_with_all_pairs: int
    circular_triads: int
    circular_triads_max: int


def transitivity(comparisons: Comparisons) -> Transitivity:
    """Count violations; ties are half a win for each."""
    shares, compared = _shares(comparisons, np.ones(comparisons.outcome.size, dtype=bool))
    violations = np.zeros(3, dtype=np.int64)
    triples = 0
    for triple in combinations(range(len(comparisons.items)), 3):
        if all(compared[one, other] for one, other in combinations(triple, 2)):
            triples += 1
            violations += _violations(shares, triple)
    raters, circles, greatest = _circles(comparisons)
    weak, moderate, strong = violations.tolist()
    return Transitivity(triples, weak, moderate, strong, raters, circles, greatest)


def _violations(shares: NDArray[np.float64], triple: tuple[int, ...]) -> NDArray[np.int64]:
    """Whether a triple breaks weak, moderate and strong transitivity, by its most favourable order."""
    best = np.ones(3, dtype=np.int64)
    first, second, third = triple
    for a, b, c in (
        (first, second, third),
        (first, third, second),
        (second, first, third),
        (second, third, first),
        (third, first, second),
        (third, second, first),
    ):
        ab, bc, ac = shares[a, b], shares[b, c], shares[a, c]
        if ab >= 0.5 and bc >= 0.5:
            best = np.minimum(best, np.array([ac < 0.5, ac < min(ab, bc), ac < max(ab, bc)], dtype=np.int64))
    return best


def _shares(
    comparisons: Comparisons, rows: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(k, k) share of wins of the row's item over the column's, and how often they were compared."""
    size = len(comparisons.items)
    wins, compared = np.zeros((size, size)), np.zeros((size, size))
    left, right, outcome = comparisons.left[rows], comparisons.right[rows], comparisons.outcome[rows]
    for_left = np.where(outcome == LEFT, 1.0, np.where(outcome == TIE, 0.5, 0.0))
    np.add.at(wins, (left, right), for_left)
    np.add.at(wins, (right, left), 1.0 - for_left)
    np.add.at(compared, (left, right), 1.0)
    np.add.at(compared, (right, left), 1.0)
    return np.divide(wins, compared, out=np.full_like(wins, np.nan), where=compared > 0), compared


def _circles(comparisons: Comparisons) -> tuple[int, int, int]:
    r"""Raters with all pairs once, their circular triads, and the greatest number possible.

    .. math::

        d &= \binom{n}{3} - \sum_i \binom{w_i}{2} \tag{1} \\
        d_{\max} &= (n^3 - n) / 24 \text{ for odd } n, \; (n^3 - 4 n) / 24 \text{ for even} \tag{2}

    w_i is how often item i of n won: a triad that is no circle has one item that won both its pairs (Kendall
    and Babington Smith 1940).
    """
    size = len(comparisons.items)
    raters = circles = 0
    most_each = (size**3 - size) // 24 if size % 2 else (size**3 - 4 * size) // 24
    if comparisons.participant is None:
        return 0, 0, 0
    for rater in range(len(comparisons.participants)):
        shares, compared = _shares(comparisons, comparisons.participant == rater)
        once = compared[np.triu_indices(size, 1)]
        if np.all(once == 1.0) and not np.any(shares == 0.5):
            wins = np.nansum(np.where(np.eye(size, dtype=bool), 0.0, shares), axis=1)
            raters += 1
            circles += round(size * (size - 1) * (size - 2) / 6 - float(np.sum(wins * (wins - 1) / 2)))
    return raters, circles, raters * most_each
