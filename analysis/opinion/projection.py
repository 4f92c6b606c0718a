"""Subject bias and inconsistency by alternating projection, as in ITU-T P.910 (2023), Annex E."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int64]
ITERATIONS_MAX = 10_000
CHANGE_MAX = 1e-10
"""Qualities stand still where they move by less, in units of the range of the votes."""
SMALLEST = float(np.finfo(np.float64).tiny) ** 0.25
COLLAPSED = 0.01
"""An inconsistency below this share of the common one is none: whoever has it would decide alone."""


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
        NaN for people of one vote, who tell no bias, and items that nobody else rated.
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
    projection often ends in. Whoever falls there is weighted by the common inconsistency, the root mean
    square of all residuals, and the rest fitted anew, until nobody falls (decision 0791).

    Parameters
    ----------
    scores : (i, j) array
        Votes, NaN where a person did not see an item; means of votes where `counts` are given.
    counts, squares : (i, j) array, optional
        How many votes each mean is of, and the sum of their squared distances from it: every vote counts.

    Returns
    -------
    Projection
    """
    seen = np.isfinite(scores)
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
        if not fallen.any() or common == 0:
            break
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
    quality = (votes * number).sum(axis=0) / number.sum(axis=0)
    iterations, change = 0, np.inf
    while True:
        iterations += 1
        bias = np.sum((votes - quality) * number, axis=1) / of_person
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
    graph = coo_array((np.ones(person.size), (person, item + people)), shape=(people + items,) * 2)
    codes = connected_components(graph, directed=False)[1].astype(np.int64)
    return codes[:people], codes[people:]
