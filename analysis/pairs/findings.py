"""What a study of paired comparisons shows: abilities, their factors, the advantage of a side, every pair."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import stats
from scipy.special import xlogy

from analysis.pairs.abilities import ItemFactors, PairsResult, Parameter, fit_abilities
from analysis.pairs.comparisons import LEFT, RIGHT, Comparisons, separated_items
from analysis.pairs.likelihood import Method
from experiments.errors import InputError


@dataclass(frozen=True)
class LikelihoodRatio:
    """A likelihood-ratio test."""

    chi2: float
    df: int
    p: float


@dataclass(frozen=True)
class PairCount:
    """One pair of items: how often it was compared, and each outcome."""

    first: str
    second: str
    n: int
    first_chosen: int
    second_chosen: int
    ties: int


@dataclass(frozen=True)
class Findings:
    """Everything the report of a study of pairs says; what could not be fitted is None, with its reason.

    Attributes
    ----------
    abilities : PairsResult or None
        Free abilities of the items.
    equal : LikelihoodRatio or None
        Whether they are all equal.
    order : Parameter or None
        Advantage of the left (first) side, in addition to free abilities.
    factors : PairsResult or None
        Abilities as the sum of the effects of the items' factors; the last test is the lack of fit.
    """

    abilities: PairsResult | None
    abilities_reason: str | None
    equal: LikelihoodRatio | None
    order: Parameter | None
    factors: PairsResult | None
    factors_reason: str | None
    pairs: tuple[PairCount, ...]


def plain_reason(reason: str, source: str) -> str:
    """Why a model was not fitted, without the file and the options of a command, which a report has not."""
    return reason.removeprefix(f"{source}: ").partition("; use --")[0].partition("; add --")[0]


def findings_of(comparisons: Comparisons, factors: ItemFactors | None) -> Findings:
    """Fit what the comparisons allow: Davidson where there are ties, else Bradley-Terry.

    Where an item always wins or loses, Firth's penalty keeps the estimates of Bradley-Terry finite.
    """
    method: Method = "davidson" if comparisons.ties else "bradley-terry"
    try:
        firth = method == "bradley-terry" and separated_items(comparisons) is not None
        abilities = fit_abilities(comparisons, method, firth=firth)
    except InputError as error:
        return Findings(
            None, str(error), None, None, None, "abilities were not fitted", pair_counts(comparisons)
        )
    fitted, reason = _with_factors(comparisons, method, factors)
    return Findings(
        abilities,
        None,
        # A penalized likelihood cannot be compared with that of equation (1).
        None if firth else equal_abilities(comparisons, abilities),
        _order(comparisons, method, firth),
        fitted,
        reason,
        pair_counts(comparisons),
    )


def _with_factors(
    comparisons: Comparisons, method: Method, factors: ItemFactors | None
) -> tuple[PairsResult | None, str | None]:
    if factors is None:
        return None, "the items differ in no factor"
    try:
        return fit_abilities(comparisons, method, factors=factors), None
    except InputError as error:
        return None, str(error)


def _order(comparisons: Comparisons, method: Method, firth: bool) -> Parameter | None:
    try:
        return fit_abilities(comparisons, method, order_effect=True, firth=firth).order_effect
    except InputError:
        return None


def equal_abilities(comparisons: Comparisons, fitted: PairsResult) -> LikelihoodRatio:
    r"""Test that all abilities are equal, of a Bradley-Terry or Davidson model without an order effect.

    With n comparisons of which t are ties the likelihood under equal abilities is at its maximum

    .. math::

        \log L_0 = t \log(t / n) + (n - t) \log\big((1 - t / n) / 2\big) \tag{1}
    """
    n, ties = fitted.n_comparisons, fitted.n_ties
    equal = float(xlogy(ties, ties / n) + xlogy(n - ties, (1 - ties / n) / 2))
    chi2, df = max(0.0, 2 * (fitted.log_likelihood - equal)), len(comparisons.items) - 1
    return LikelihoodRatio(chi2, df, float(stats.chi2.sf(chi2, df)))


def pair_counts(comparisons: Comparisons) -> tuple[PairCount, ...]:
    """Every pair that was compared, in the order of the items; sides are taken together."""
    counts = []
    left, right, outcome = comparisons.left, comparisons.right, comparisons.outcome
    for first, second in combinations(range(len(comparisons.items)), 2):
        along, across = (left == first) & (right == second), (left == second) & (right == first)
        n = int(np.sum(along | across))
        if n:
            won = int(np.sum((along & (outcome == LEFT)) | (across & (outcome == RIGHT))))
            lost = int(np.sum((along & (outcome == RIGHT)) | (across & (outcome == LEFT))))
            names = comparisons.items[first], comparisons.items[second]
            counts.append(PairCount(*names, n, won, lost, n - won - lost))
    return tuple(counts)
