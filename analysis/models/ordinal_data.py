"""Trials and parameters of the cumulative-logit mixed model."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class OrdinalData:
    """Trials: x (n, f), category codes from 0 (n,), participant and item codes (n,).

    `z` (n, c) are the columns whose coefficients differ between participants, `term` (c,) the random term,
    from 0, that each belongs to: the columns of a term share one SD.
    """

    x: Floats = field(repr=False)
    z: Floats = field(repr=False)
    term: Integers = field(repr=False)
    category: Integers = field(repr=False)
    participant: Integers = field(repr=False)
    item: Integers = field(repr=False)
    n_categories: int
    n_participants: int
    n_items: int

    @property
    def n_sds(self) -> int:
        """SDs of the participants' terms, and that of the items."""
        return int(self.term.max()) + 2


@dataclass(frozen=True)
class Parameters:
    """Thresholds (categories - 1,), coefficients (f,), SDs of participants' terms and, last, of items.

    A likelihood's gradient has this form too. It is even in every SD: at zero, its derivative is zero.
    """

    thresholds: Floats
    beta: Floats
    sd: Floats


def by_sd(by_log_sd: Floats, sd: Floats) -> Floats:
    """Derivatives by SDs from those by their logarithms; zero where the SD is, as the likelihood is even."""
    return np.divide(by_log_sd, sd, out=np.zeros(len(sd)), where=sd != 0)
