"""Ratings in units of their own, so that neither a far origin nor a large unit costs a model its digits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """A model is fitted to (rating - middle) / scale: sums of squares of times since 1970 have no digit left.

    `middle` is whole in units of `scale`, a power of two: of ordinary ratings nothing is rounded.
    """

    middle: float
    scale: float

    def scaled(self, ratings: Floats) -> Floats:
        """The ratings in these units."""
        return (ratings - self.middle) / self.scale

    def interval(self, ends: tuple[float, float], intercept: bool = False) -> tuple[float, float]:
        """An interval in the ratings' own units."""
        low, high = (end * self.scale + (self.middle if intercept else 0.0) for end in ends)
        return low, high


def units_of(ratings: Floats) -> Units:
    """Units in which ratings that vary lie about zero and spread by about one."""
    scale = float(2.0 ** np.round(np.log2(ratings.std())))
    return Units(float(np.round(ratings.mean() / scale) * scale), scale)
