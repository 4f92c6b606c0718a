"""Between the baked or drawn levels of a closing eyelid: linear, in linear light."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def level_weights(levels: NDArray[np.float64], closures: ArrayLike) -> NDArray[np.float64]:
    """Weights over the levels that show each closure.

    Parameters
    ----------
    levels : float64 array (n,)
        Closures that there are pictures of, ascending from 0 to 1.
    closures : array-like (m,)
        Closures to be shown, each between 0 and 1.

    Returns
    -------
    float64 array (m, n)
        Each row sums to 1 and has at most two neighbours above 0. The mean of rows is the weight vector of
        motion blur over these closures.

    Examples
    --------
    >>> level_weights(np.array([0.0, 0.5, 1.0]), [0.25, 1.0])
    array([[0.5, 0.5, 0. ],
           [0. , 0. , 1. ]])
    """
    closures = np.asarray(closures, dtype=np.float64)
    upper = np.clip(np.searchsorted(levels, closures, side="left"), 1, len(levels) - 1)
    low, high = levels[upper - 1], levels[upper]
    share = (closures - low) / (high - low)
    weights = np.zeros((len(closures), len(levels)))
    rows = np.arange(len(closures))
    weights[rows, upper - 1] = 1.0 - share
    weights[rows, upper] += share
    return weights
