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


def alternating_projection(scores: Array) -> Projection:
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
        Votes, NaN where a person did not see an item.

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
    fitted = _projected(scores[people][:, items])
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


def _projected(scores: Array) -> Projection:
    """The same where everybody has two votes or more."""
    seen = np.isfinite(scores)
    middle = float(np.nanmean(scores))
    unit = float(np.nanmax(scores) - np.nanmin(scores)) or 1.0
    votes = np.where(seen, (scores - middle) / unit, 0.0)
    person_groups, groups = _tied(seen)
    held = np.zeros(len(votes), dtype=bool)
    while True:
        fit = _weighted(votes, seen, person_groups, held)
        common = _common(fit.residual, seen)
        fallen = (fit.spread <= COLLAPSED * common) & ~held
        if not fallen.any() or common == 0:
            break
        held |= fallen
    error = np.divide(1.0, np.sqrt(fit.weight.sum(axis=0)))
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
    weight: Array
    iterations: int
    converged: bool


def _weighted(votes: Array, seen: Flags, groups: Codes, held: Flags) -> _Fit:
    """Alternate until the qualities stand still; people `held` are weighted by the common inconsistency."""
    quality = votes.sum(axis=0) / seen.sum(axis=0)
    iterations, change = 0, np.inf
    while True:
        iterations += 1
        bias = np.sum((votes - quality) * seen, axis=1) / seen.sum(axis=1)
        bias -= (np.bincount(groups, weights=bias) / np.bincount(groups))[groups]
        residual = (votes - quality - bias[:, None]) * seen
        centred = (residual - (residual.sum(axis=1) / seen.sum(axis=1))[:, None]) * seen
        spread = np.sqrt((centred**2).sum(axis=1) / seen.sum(axis=1))
        common = _common(residual, seen)
        # so small that it decides alone, which is seen and held afterwards, and yet divides nothing by zero
        used = np.maximum(np.where(held, common, spread), max(COLLAPSED**2 * common, SMALLEST))
        weight = seen / used[:, None] ** 2
        updated = np.sum((votes - bias[:, None]) * weight, axis=0) / weight.sum(axis=0)
        change = float(np.linalg.norm(updated - quality))
        quality = updated
        if change < CHANGE_MAX or iterations == ITERATIONS_MAX:
            return _Fit(quality, bias, residual, spread, weight, iterations, change < CHANGE_MAX)


def _common(residual: Array, seen: Flags) -> float:
    """Root mean square of all residuals; 0 where they are those of rounding."""
    common = float(np.sqrt(np.sum(residual**2) / seen.sum()))
    return common if common > CHANGE_MAX else 0.0


def _tied(seen: Flags) -> tuple[Codes, Codes]:
    """Which people and which items votes tie together, as numbers from 0."""
    people, items = seen.shape
    person, item = np.nonzero(seen)
    graph = coo_array((np.ones(person.size), (person, item + people)), shape=(people + items,) * 2)
    codes = connected_components(graph, directed=False)[1].astype(np.int64)
    return codes[:people], codes[people:]
