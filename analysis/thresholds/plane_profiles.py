"""Profile likelihood intervals of a psychometric function of two stimulus variables."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy import optimize

from analysis.thresholds.likelihood import CHI2_95, Interval
from analysis.thresholds.plane_likelihood import Array, PlaneLikelihood

BROAD = (1 / 3, 1 / 10)
"""Spreads from which a fit starts too, in ranges of x: guesses and lapses make several maxima."""


class PlaneProfiles:
    """Ends of the likelihood's profiles: the predictor is written so that one parameter is a constant.

    Attributes
    ----------
    best : (float, float, float)
        b0, b1 and b2 of b0 + b1 x + b2 z at the maximum, from which every fit starts.
    """

    def __init__(
        self, link: PlaneLikelihood, x: Array, z: Array, value: float, best: tuple[float, float, float]
    ) -> None:
        self.link, self.x, self.z, self.value, self.best = link, x, z, value, best
        self.width, self.span = float(np.ptp(x)), float(np.ptp(z))

    def threshold(self, best: float, at: float) -> Interval:
        """Of the threshold at z = `at`: b1 (x - t) + b2 (z - at)."""

        def loss(t: float) -> float:
            starts = [self.best[1:], *((1 / (share * self.width), 0.0) for share in BROAD)]
            return self._loss(np.column_stack([self.x - t, self.z - at]), starts)

        return self._ends(loss, best, self.width / 20, 10 * self.width)

    def tilt(self, best: float) -> Interval:
        """b0 + b1 (x - b z)."""

        def loss(b: float) -> float:
            columns = np.column_stack([np.ones_like(self.x), self.x - b * self.z])
            along = float(columns[:, 1].mean())
            broad = ((-along / (share * self.width), 1 / (share * self.width)) for share in BROAD)
            return self._loss(columns, [self.best[:2], *broad])

        return self._ends(loss, best, self.width / self.span / 20, 20 * self.width / self.span)

    def spread(self, best: float) -> Interval:
        """x / s is an offset beside b0 + b2 z; searched by the logarithm."""

        def loss(log_s: float) -> float:
            columns = np.column_stack([np.ones_like(self.x), self.z])
            s = float(np.exp(log_s))
            starts = [(self.best[0], self.best[2]), (-float(self.x.mean()) / s, 0.0)]
            return self._loss(columns, starts, self.x / s)

        ends = self._ends(loss, float(np.log(best)), 0.1, 8.0)
        return Interval(*(None if end is None else float(np.exp(end)) for end in (ends.low, ends.high)))

    def _loss(
        self, columns: Array, starts: Sequence[tuple[float, ...]], offset: Array | float = 0.0
    ) -> float:
        value = self.link.best(columns, [np.array(start) for start in starts], offset)[1]
        return 2 * (self.value - value) - CHI2_95

    def _ends(self, loss: Callable[[float], float], best: float, step: float, most: float) -> Interval:
        return Interval(self._end(loss, best, -step, most), self._end(loss, best, step, most))

    def _end(self, loss: Callable[[float], float], best: float, step: float, most: float) -> float | None:
        inside = best
        while abs(inside + step - best) <= most:
            outside = inside + step
            if loss(outside) > 0:
                return float(optimize.brentq(loss, inside, outside, xtol=1e-10 * abs(step), rtol=1e-12))
            inside, step = outside, step * 1.6
        return None
