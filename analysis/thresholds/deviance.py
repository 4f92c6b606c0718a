"""The p of a deviance against the saturated model, where enough answers repeat a condition."""

import numpy as np
from numpy.typing import NDArray
from scipy import special

REPEATS = 5.0
"""Mean number of answers of a condition from which the deviance is distributed about as chi2.

With one answer each it does not depend on how well the function fits (McCullagh & Nelder 1989, 4.4.5).
"""


def fit_p(deviance: float, df: int, counts: NDArray[np.float64]) -> float:
    """The p of a deviance on `df`; NaN without df, or where `counts` (m,) of a condition are too few."""
    if df <= 0 or too_few_repeats(counts):
        return float("nan")
    return float(special.chdtrc(df, deviance))


def too_few_repeats(counts: NDArray[np.float64]) -> bool:
    """Whether conditions are repeated too rarely for a deviance to say anything."""
    return float(np.mean(counts)) < REPEATS
