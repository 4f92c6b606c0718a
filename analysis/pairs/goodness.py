"""How well a model of paired comparisons fits the pairs."""

import numpy as np
from numpy.typing import NDArray

from analysis.pairs.comparisons import LEFT, RIGHT
from analysis.pairs.likelihood import Counts, Fit, Model
from analysis.pairs.pairs_result import Goodness
from analysis.thresholds.deviance import fit_p

Array = NDArray[np.float64]


def goodness_of_fit(model: Model, counts: Counts, fitted: Fit) -> Goodness:
    """Compare with the saturated model of the pairs: only this pair form tells a fit.

    Pairs are taken together over their two orders unless the model has an order effect.
    """
    outcomes, expected = counts.outcomes, counts.totals[:, None] * fitted.shares
    if not model.order_effect:
        outcomes, expected = _unordered(counts, outcomes), _unordered(counts, expected)
    ratio = np.where(outcomes > 0, outcomes / np.where(expected > 0, expected, 1.0), 1.0)
    deviance = float(2 * np.sum(outcomes * np.log(ratio)))
    df = outcomes.shape[0] * (outcomes.shape[1] - 1) - model.names
    return Goodness(deviance, df, fit_p(deviance, df, outcomes.sum(axis=1)), model.order_effect)


def _unordered(counts: Counts, values: Array) -> Array:
    """Add up both orders of a pair (m, o): the item that comes first in the alphabet as the left one."""
    swapped = counts.left > counts.right
    turned = values.copy()
    turned[swapped, LEFT], turned[swapped, RIGHT] = values[swapped, RIGHT], values[swapped, LEFT]
    low, high = np.minimum(counts.left, counts.right), np.maximum(counts.left, counts.right)
    _, index = np.unique(np.stack([low, high]), axis=1, return_inverse=True)
    total = np.zeros((int(index.max()) + 1, values.shape[1]))
    np.add.at(total, index.ravel(), turned)
    return total
