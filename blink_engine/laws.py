"""The distributions the engine draws from, each from the numbers of one stream."""

import math
from dataclasses import dataclass
from typing import Literal

from blink_engine.random_numbers import RandomNumbers


@dataclass(frozen=True)
class Law:
    """A distribution of positive numbers.

    Attributes
    ----------
    kind : {"lognormal", "gamma", "fixed"}
        `lognormal`: exp(log(median) + spread z), z standard normal. `gamma`: shape `spread`, scaled
        so that the median is about `median` (Wilson-Hilferty). `fixed`: always `median`.
    median : float
        In the unit of what is drawn.
    spread : float
        Standard deviation of the logarithm, or the gamma shape.
    """

    kind: Literal["lognormal", "gamma", "fixed"]
    median: float
    spread: float = 0.0

    def draw(self, numbers: RandomNumbers) -> float:
        """Draw one number; a log-normal and a fixed law use one uniform number, a gamma two or more."""
        if self.kind == "gamma":
            return self._scale() * _gamma(self.spread, numbers)
        z = numbers.normal()
        return self.median if self.kind == "fixed" else self.median * math.exp(self.spread * z)

    def draw_under_way(self, numbers: RandomNumbers) -> float:
        """Draw the interval that a random moment falls into: the longer one is, the likelier it is met.

        Its density is x f(x) / mean. A log-normal's is log-normal with the median exp(spread^2) times as
        great, a gamma's a gamma of the same scale and a shape greater by 1.
        """
        if self.kind == "gamma":
            return self._scale() * _gamma(self.spread + 1.0, numbers)
        drawn = self.draw(numbers)
        return drawn if self.kind == "fixed" else drawn * math.exp(self.spread**2)

    @property
    def mean(self) -> float:
        """Expected value."""
        if self.kind == "gamma":
            return self._scale() * self.spread
        return self.median * math.exp(self.spread**2 / 2) if self.kind == "lognormal" else self.median

    def _scale(self) -> float:
        shape = self.spread
        return self.median / (shape * (1.0 - 1.0 / (9.0 * shape)) ** 3)

    def with_mean(self, mean: float) -> "Law":
        """Return the law of the same spread whose mean is `mean`."""
        return Law(self.kind, self.median * mean / self.mean, self.spread)


def _gamma(shape: float, numbers: RandomNumbers) -> float:
    """Draw from the gamma law of scale 1 by Marsaglia & Tsang (2000), ACM TOMS 26(3), 363-372."""
    if shape < 1.0:
        boost = math.pow(numbers.uniform(), 1.0 / shape)
        return boost * _gamma(shape + 1.0, numbers)
    d = shape - 1.0 / 3.0
    c = 1.0 / math.sqrt(9.0 * d)
    while True:
        x, u = numbers.normal(), numbers.uniform()
        v = (1.0 + c * x) ** 3
        if v > 0.0 and math.log(u) < 0.5 * x * x + d - d * v + d * math.log(v):
            return d * v
