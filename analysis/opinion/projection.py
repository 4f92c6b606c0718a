"""Subject bias and inconsistency by alternating projection, as in ITU-T P.910 (2023), Annex E."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ITERATIONS_MAX = 1000
CHANGE_MAX = 1e-10
INCONSISTENCY_MIN = 1e-6
"""Keeps the weight of somebody who agrees with the recovered quality exactly from growing without end."""


@dataclass(frozen=True, eq=False)
class Projection:
    """Recovered quality of the items (j,) with its SE, bias and inconsistency of the people (i,)."""

    quality: Array
    quality_se: Array
    bias: Array
    inconsistency: Array
    iterations: int


def alternating_projection(scores: Array) -> Projection:
    r"""Fit the model of Li et al. (2020, Electronic Imaging, HVEI-131),

    .. math::

        u_{ij} = \psi_j + \Delta_i + \upsilon_i X_{ij} \tag{1}

    u a vote, psi the quality of item j, Delta the bias of person i (mean 0), upsilon the person's
    inconsistency, X standard normal. In turn: biases are mean residuals; inconsistencies are the residuals'
    standard deviations; qualities are means of unbiased votes weighted by 1 / upsilon^2; until the qualities
    move by less than 1e-10.

    Parameters
    ----------
    scores : (i, j) array
        Votes, NaN where a person did not see an item.

    Returns
    -------
    Projection
    """
    seen = np.isfinite(scores)
    votes = np.where(seen, scores, 0.0)
    quality = votes.sum(axis=0) / seen.sum(axis=0)
    iterations = 0
    while True:
        iterations += 1
        bias = np.sum((votes - quality) * seen, axis=1) / seen.sum(axis=1)
        bias -= bias.mean()
        residual = (votes - quality - bias[:, None]) * seen
        centred = (residual - (residual.sum(axis=1) / seen.sum(axis=1))[:, None]) * seen
        spread = np.maximum(np.sqrt((centred**2).sum(axis=1) / seen.sum(axis=1)), INCONSISTENCY_MIN)
        weight = seen / spread[:, None] ** 2
        updated = np.sum((votes - bias[:, None]) * weight, axis=0) / weight.sum(axis=0)
        change = float(np.linalg.norm(updated - quality))
        quality = updated
        if change < CHANGE_MAX or iterations == ITERATIONS_MAX:
            return Projection(quality, 1 / np.sqrt(weight.sum(axis=0)), bias, spread, iterations)
