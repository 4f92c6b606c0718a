"""Opinion scores as in ITU-T P.910: means with intervals, and the biases of those who gave them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analysis.votes import NAMED_MAX, ScoreMethod, Standard, Votes, bt500_counts, names_where
from experiments.errors import InputError

# Subject bias and inconsistency by alternating projection, as in ITU-T P.910 (2023), Annex E.

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int64]
ITERATIONS_MAX = 10_000
CHANGE_MAX = 1e-10
"""Qualities stand still where they move by less, in units of the range of the votes."""
SMALLEST = float(np.finfo(np.float64).tiny) ** 0.25
COLLAPSED = 0.01
"""An inconsistency below this share of the common one counts as zero: that person alone would decide."""


@dataclass(frozen=True, eq=False)
class Projection:
    """Recovered quality of the items (j,) with its SE, bias and inconsistency of the people (i,).

    The SE is P.910's, of each item: the standard deviation (divided by n) of its n votes without the biases,
    over the root of n; NaN for one vote.

    Attributes
    ----------
    held : (i,) bool
        Whose inconsistency fell to nothing, and who are weighted by the common one; their `inconsistency` is
        that of their residuals.
    groups, person_groups : (j,) and (i,) int64
        Which items and people votes tie together, numbered from 0; biases are 0 on average in each. -1 with
        NaN for people of one vote, whose bias is unknown, and items that nobody else rated.
    converged : bool
        Whether the qualities stood still.
    """

    quality: Array
    quality_se: Array
    bias: Array
    inconsistency: Array
    held: Flags
    groups: Codes
    person_groups: Codes
    iterations: int
    converged: bool


def alternating_projection(
    scores: Array, counts: Array | None = None, squares: Array | None = None
) -> Projection:
    r"""Fit the model of Li et al. (2020, Electronic Imaging, HVEI-131),

    .. math::

        u_{ij} = \psi_j + \Delta_i + \upsilon_i X_{ij} \tag{1}

    u a vote, psi the quality of item j, Delta the bias of person i (mean 0), upsilon the person's
    inconsistency, X standard normal. In turn: biases are mean residuals; inconsistencies are the residuals'
    standard deviations; qualities are means of unbiased votes weighted by 1 / upsilon^2; until the qualities
    move by less than 1e-10 of the votes' range.

    Its likelihood has no maximum: it grows without end where one person's residuals go to zero, which the
    projection often ends in. People for whom this happens are weighted by the common inconsistency, the root
    mean square of all residuals, and the rest is fitted again, until it happens to nobody (decision 0791).

    Parameters
    ----------
    scores : (i, j) array
        Votes, NaN where a person did not see an item; means of votes where `counts` are given.
    counts, squares : (i, j) array, optional
        How many votes each mean is of, and the sum of their squared distances from it: every vote was used.

    Returns
    -------
    Projection
    """
    seen = np.isfinite(scores)
    # One vote cannot be divided into a bias and the rest.
    people = seen.sum(axis=1) > 1
    items = seen[people].any(axis=0)
    nobody, nothing = np.full(people.size, np.nan), np.full(items.size, np.nan)
    if not people.any():
        flags, codes = np.zeros(people.size, dtype=bool), np.full(people.size, -1)
        return Projection(
            nothing,
            nothing,
            nobody,
            nobody,
            flags,
            np.full(items.size, -1),
            codes,
            iterations=0,
            converged=True,
        )
    alone = np.ones_like(scores) if counts is None else counts
    apart = np.zeros_like(scores) if squares is None else squares
    fitted = _projected(*(values[people][:, items] for values in (scores, alone, apart)))
    return Projection(
        _put(fitted.quality, items, np.nan),
        _put(fitted.quality_se, items, np.nan),
        _put(fitted.bias, people, np.nan),
        _put(fitted.inconsistency, people, np.nan),
        _put(fitted.held, people, False),
        _put(fitted.groups, items, -1),
        _put(fitted.person_groups, people, -1),
        fitted.iterations,
        fitted.converged,
    )


def _put(values: NDArray[Any], at: Flags, beside: float) -> NDArray[Any]:
    whole = np.full(at.size, beside, dtype=values.dtype)
    whole[at] = values
    return whole


def _projected(scores: Array, counts: Array, squares: Array) -> Projection:
    """The same where everybody has voted on two items or more."""
    seen = np.isfinite(scores)
    # Votes in units of their range: the limits above then hold for any scale.
    middle = float(np.nanmean(scores))
    unit = float(np.nanmax(scores) - np.nanmin(scores)) or 1.0
    votes = np.where(seen, (scores - middle) / unit, 0.0)
    number, apart = np.where(seen, counts, 0.0), np.where(seen, squares, 0.0) / unit**2
    person_groups, groups = _tied(seen)
    held = np.zeros(len(votes), dtype=bool)
    while True:
        fit = _weighted(votes, number, apart, person_groups, held)
        common = _common(fit.residual, number, apart)
        fallen = (fit.spread <= COLLAPSED * common) & ~held
        # Where all residuals are those of rounding, everybody's fall to nothing alike.
        if not fallen.any() or common == 0:
            break
        # Held for good, so that the outer loop ends after as many rounds as there are people at most.
        held |= fallen
    error = _errors(votes - fit.bias[:, None], number, apart)
    return Projection(
        fit.quality * unit + middle,
        error * unit,
        fit.bias * unit,
        fit.spread * unit,
        held,
        groups,
        person_groups,
        fit.iterations,
        fit.converged,
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    quality: Array
    bias: Array
    residual: Array
    spread: Array
    iterations: int
    converged: bool


def _errors(unbiased: Array, number: Array, apart: Array) -> Array:
    """Standard errors (j,) of items from means without biases, their numbers of votes and spreads."""
    n = number.sum(axis=0)
    mean = (unbiased * number).sum(axis=0) / n
    variance = ((unbiased - mean) ** 2 * number + apart).sum(axis=0) / n
    return np.where(n > 1, np.sqrt(variance / n), np.nan)


def _weighted(votes: Array, number: Array, apart: Array, groups: Codes, held: Flags) -> _Fit:
    """Alternate until the qualities stand still; people `held` are weighted by the common inconsistency."""
    of_person, seen = number.sum(axis=1), number > 0
    # From the mean opinion scores, which the projection leaves only as far as people differ.
    quality = (votes * number).sum(axis=0) / number.sum(axis=0)
    iterations, change = 0, np.inf
    while True:
        iterations += 1
        bias = np.sum((votes - quality) * number, axis=1) / of_person
        # Qualities and biases share a constant in each group of people tied by votes: here it is given to
        # the qualities.
        bias -= (np.bincount(groups, weights=bias) / np.bincount(groups))[groups]
        residual = (votes - quality - bias[:, None]) * seen
        centred = residual - ((residual * number).sum(axis=1) / of_person)[:, None]
        spread = np.sqrt((centred**2 * number + apart).sum(axis=1) / of_person)
        common = _common(residual, number, apart)
        # so small that it decides alone, which is seen and held afterwards, and yet divides nothing by zero
        used = np.maximum(np.where(held, common, spread), max(COLLAPSED**2 * common, SMALLEST))
        weight = number / used[:, None] ** 2
        updated = np.sum((votes - bias[:, None]) * weight, axis=0) / weight.sum(axis=0)
        change = float(np.linalg.norm(updated - quality))
        quality = updated
        if change < CHANGE_MAX or iterations == ITERATIONS_MAX:
            return _Fit(quality, bias, residual, spread, iterations, change < CHANGE_MAX)


def _common(residual: Array, number: Array, apart: Array) -> float:
    """Root mean square of all residuals; 0 where they are those of rounding."""
    common = float(np.sqrt(np.sum(residual**2 * number + apart) / number.sum()))
    return common if common > CHANGE_MAX else 0.0


def _tied(seen: Flags) -> tuple[Codes, Codes]:
    """Which people and which items votes tie together, as numbers from 0."""
    people, items = seen.shape
    person, item = np.nonzero(seen)
    # People and items are the nodes of one graph, and the votes its edges.
    graph = coo_array((np.ones(person.size), (person, item + people)), shape=(people + items,) * 2)
    codes = connected_components(graph, directed=False)[1].astype(np.int64)
    return codes[:people], codes[people:]


# Caveats about recovered scores: who contributed nothing, and what has no common scale.


def doubts(model: Projection, people: Sequence[str], items: Sequence[str]) -> Iterator[str]:
    """Decisions on the model of votes by the people and items named, in words."""
    if (alone := model.person_groups < 0).any():
        counts = "counts" if alone.sum() == 1 else "count"
        yield (
            f"bias cannot be estimated from one vote: {names_where(people, alone)} {counts} in MOS, but not "
            "in recovered scores"
        )
    if (lacking := model.groups < 0).any():
        yield f"only people with one vote rated {names_where(items, lacking)}: no recovered score"
    if model.held.any():
        yield (
            f"the estimated inconsistency of {names_where(people, model.held)} is zero, which would let them "
            "alone determine the scores: the common inconsistency was used"
        )
    if (number := int(model.groups.max()) + 1) > 1:
        told = " | ".join(
            names_where(items, model.groups == group) for group in range(min(number, NAMED_MAX))
        )
        more = f" and {number - NAMED_MAX} more" if number > NAMED_MAX else ""
        yield (
            f"the items form {number} groups with no person in common ({told}{more}): scores and biases "
            "cannot be compared between groups"
        )
    if not model.converged:
        yield (
            f"recovered scores did not converge in {model.iterations} rounds: too few people rated several "
            "items"
        )


# Who gave the opinions: bias, inconsistency, agreement with the others, and BT.500's ruling.


@dataclass(frozen=True)
class PersonScore:
    """One person: bias against the others, inconsistency, correlation with the MOS, and BT.500's ruling.

    `bias`, `inconsistency` and `group` (the number of the items' group) are None for people of one vote.
    Whose inconsistency fell to nothing has `common_weight`: the one that all people have in common.
    """

    name: str
    n: int
    bias: float | None
    inconsistency: float | None
    common_weight: bool
    group: int | None
    correlation: float | None
    rejected_bt500: bool


def person_scores(
    names: Sequence[str], scores: Array, counts: Array, model: Projection
) -> tuple[PersonScore, ...]:
    """Scores of each person from votes (people, items), NaN where none, and their numbers."""
    rejected = bt500_counts(scores)[2]
    mos = np.nanmean(scores, axis=0)
    people = []
    for index, name in enumerate(names):
        row = scores[index]
        seen = np.isfinite(row)
        varied = seen.sum() > 2 and np.ptp(row[seen]) > 0 and np.ptp(mos[seen]) > 0
        told = model.person_groups[index] >= 0
        people.append(
            PersonScore(
                name,
                int(counts[index].sum()),
                float(model.bias[index]) if told else None,
                float(model.inconsistency[index]) if told else None,
                bool(model.held[index]),
                int(model.person_groups[index]) + 1 if told else None,
                float(np.corrcoef(row[seen], mos[seen])[0, 1]) if varied else None,
                bool(rejected[index]),
            )
        )
    return tuple(people)


# Mean opinion scores with intervals, and a model of the people who gave them.

Repeats = Literal["mean", "votes"]


@dataclass(frozen=True)
class ItemScore:
    """One item. mos, sd (n - 1), se and the 95% interval (t with n - 1); `recovered` from the model.

    What does not exist (an SD of one vote, a recovered score where only people of one vote rated) is NaN.
    `group` numbers the items that raters tie together from 1; None where nothing was recovered.
    """

    name: str
    mos: float
    sd: float
    n: int
    se: float
    ci_low: float
    ci_high: float
    recovered: float
    recovered_se: float
    recovered_ci_low: float
    recovered_ci_high: float
    group: int | None


@dataclass(frozen=True)
class OpinionResult:
    """Everything `analysis opinion` knows of a table."""

    items: tuple[ItemScore, ...]
    participants: tuple[PersonScore, ...]
    n_votes: int
    repeats: Repeats
    iterations: int
    n_groups: int
    decisions: tuple[str, ...]
    method: ScoreMethod = "acr"
    z_scores: bool = False


def fit_opinion(votes: Votes, repeats: Repeats = "mean", standard: Standard = Standard()) -> OpinionResult:
    """Compute opinion scores.

    Parameters
    ----------
    votes : Votes
    repeats : {"mean", "votes"}
        A person's repeated votes on an item count as their mean (n is people) or each by itself (n is votes),
        in the opinion scores and in the recovered ones.
    standard : Standard
        How the votes were made into scores, which the tables name.

    Raises
    ------
    InputError
        Fewer than two people or items; repeats of scores against hidden references.
    """
    if repeats == "votes" and standard.method == "acr-hr":
        raise InputError("--repeats votes is not for --method acr-hr, which compares each person's means")
    if len(votes.people) < 2 or len(votes.items) < 2:
        raise InputError(
            f"{votes.source}: expected two people and two items or more, got {len(votes.people)} and "
            f"{len(votes.items)}"
        )
    each = (votes.counts, votes.squares) if repeats == "votes" else ()
    model = alternating_projection(votes.scores, *each)
    decisions = list(votes.decisions)
    if np.any(votes.counts > 1):
        word = "a person's mean counts once" if repeats == "mean" else "every vote was used"
        decisions.append(f"some people rated an item more than once: {word}")
    decisions += doubts(model, votes.people, votes.items)
    return OpinionResult(
        tuple(_item(votes, model, index, repeats) for index in range(len(votes.items))),
        person_scores(votes.people, votes.scores, votes.counts, model),
        int(votes.counts.sum()),
        repeats,
        model.iterations,
        int(model.groups.max()) + 1,
        tuple(decisions),
        standard.method,
        standard.z_scores,
    )


def _item(votes: Votes, model: Projection, index: int, repeats: Repeats) -> ItemScore:
    column = votes.scores[:, index]
    values = votes.all_votes[index] if repeats == "votes" else column[np.isfinite(column)]
    n, mos = values.size, float(values.mean())
    sd = float(values.std(ddof=1)) if n > 1 else float("nan")
    se = sd / float(np.sqrt(n))
    half = float(stats.t.ppf(0.975, n - 1)) * se if n > 1 else float("nan")
    recovered, error = float(model.quality[index]), float(model.quality_se[index])
    wide = float(stats.norm.ppf(0.975)) * error
    return ItemScore(
        votes.items[index],
        mos,
        sd,
        n,
        se,
        mos - half,
        mos + half,
        recovered,
        error,
        recovered - wide,
        recovered + wide,
        int(model.groups[index]) + 1 if model.groups[index] >= 0 else None,
    )
