"""The likelihood of a psychometric function, its maximum and its profiles."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

Array = NDArray[np.float64]
Shape = Literal["normal", "logistic", "weibull"]
LAPSE_MAX = 0.1
CHI2_95 = float(stats.chi2.ppf(0.95, 1))
BOUND = 1e-9
GRID = 41
"""Values of a parameter among which the start of a profile's fit is looked for."""
QUASI_NEWTON: Any = {"ftol": 1e-15, "gtol": 1e-9, "maxiter": 500}
SIMPLEX: Any = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 1000}


@dataclass(frozen=True, eq=False)
class Trials:
    """Trials counted by stimulus: levels x (m,), trials n (m,) and positive (or correct) answers k (m,)."""

    x: Array
    n: Array
    k: Array


@dataclass(frozen=True)
class Interval:
    """A profile likelihood interval; an end is None where the likelihood never falls far enough."""

    low: float | None
    high: float | None

    def changed(self, change: Callable[[float], float]) -> "Interval":
        """The same interval of a parameter written in another way, which rises with this one."""
        return Interval(*(None if end is None else change(end) for end in (self.low, self.high)))


def normal_density(eta: Array) -> Array:
    """The standard normal density; scipy's takes ten times as long for a few values."""
    return np.asarray(np.exp(-(eta**2) / 2) / np.sqrt(2 * np.pi), dtype=np.float64)


def function(shape: Shape, x: Array, location: float, log_spread: float) -> Array:
    r"""Return the underlying F(x).

    .. math::

        F = \Phi((x - a) / b) \tag{1}

        F = 1 / (1 + e^{-(x - a) / b}) \tag{2}

        F = 1 - 2^{-(x / a)^b} \tag{3}

    a is the threshold (F = 1/2), b the spread: normal (1), logistic (2), Weibull (3, x > 0).
    """
    b = np.exp(log_spread)
    if shape == "weibull":
        with np.errstate(over="ignore"):
            # exp overflows above 709; long before, F is 1 to the last digit.
            power = np.exp(np.minimum(b * (np.log(x) - np.log(location)), 700.0))
        return np.asarray(-np.expm1(-np.log(2.0) * power))
    z = (x - location) / b
    return np.asarray(special.ndtr(z) if shape == "normal" else special.expit(z))


class Likelihood:
    """The likelihood of one data set; parameters are location, log spread and, if fitted, lapse.

    If `falling` is not given, the answers decide it.
    """

    def __init__(
        self, trials: Trials, shape: Shape, guess: float, lapse: float | None, falling: bool | None = None
    ) -> None:
        self.trials, self.shape, self.guess, self.lapse = trials, shape, guess, lapse
        centred = trials.x - np.average(trials.x, weights=trials.n)
        # The sign of the covariance of stimulus and answer.
        self.falling = float(np.sum(centred * trials.k)) < 0 if falling is None else falling
        self.width = float(trials.x.max() - trials.x.min())

    def probabilities(self, values: Array) -> Array:
        """Return P(x) at every level (m,)."""
        lapse = values[2] if self.lapse is None else self.lapse
        rising = function(self.shape, self.trials.x, values[0], values[1])
        f = 1.0 - rising if self.falling else rising
        # One answer against a saturated function then costs 27.6, and not infinity: the search can go on
        # past it.
        return np.asarray(np.clip(self.guess + (1 - self.guess - lapse) * f, 1e-12, 1 - 1e-12))

    def negative(self, values: Array) -> float:
        """Return minus the log-likelihood, without its binomial coefficients."""
        p = self.probabilities(values)
        return -float(self.trials.k @ np.log(p) + (self.trials.n - self.trials.k) @ np.log1p(-p))

    def maximum(self, held: dict[int, float], start: Array | None = None) -> tuple[Array, float]:
        """Maximize over the parameters that are not `held`; return them all and the log-likelihood."""
        size = 3 if self.lapse is None else 2
        free = [index for index in range(size) if index not in held]

        def whole(values: Array) -> Array:
            full = np.zeros(size)
            full[free] = values
            for index, value in held.items():
                full[index] = value
            return full

        def negative(values: Array) -> float:
            return self.negative(whole(values))

        starts = [start] if start is not None else self._starts(size)
        bounds = [self._bounds()[index] for index in free]
        if held and free:
            starts.append(whole(self._scanned(negative, bounds)))
        fits = [
            optimize.minimize(
                negative,
                np.clip(one[free], [low for low, _ in bounds], [high for _, high in bounds]),
                method="L-BFGS-B",
                bounds=bounds,
                options=QUASI_NEWTON,
            )
            for one in starts
        ]
        best = min(fits, key=lambda fit: float(fit.fun))
        # Along a profile the start is near and a loss to 1e-9 will do.
        polished = best.x if held else self._polished(whole, best.x, bounds)
        return whole(polished), -self.negative(whole(polished))

    def _scanned(self, negative: Callable[[Array], float], bounds: list[tuple[float, float]]) -> Array:
        """The best of a grid within `bounds`: far from the maximum the profile leaves its start's valley."""
        # The range of the lapse rate is short: three values are enough.
        sizes = [3 if high == LAPSE_MAX else GRID for _, high in bounds]
        axes = [np.linspace(low, high, size) for (low, high), size in zip(bounds, sizes, strict=True)]
        return np.array(min(product(*axes), key=lambda values: negative(np.array(values))))

    def _polished(
        self, whole: Callable[[Array], Array], values: Array, bounds: list[tuple[float, float]]
    ) -> Array:
        """Refine by the simplex method: the quasi-Newton steps end at the noise of their differences."""
        if not values.size:
            return values
        options: Any = {**SIMPLEX, "initial_simplex": self._simplex(values, bounds)}

        def negative(inner: Array) -> float:
            return self.negative(whole(inner))

        fit = optimize.minimize(negative, values, method="Nelder-Mead", bounds=bounds, options=options)
        return np.asarray(fit.x if fit.fun <= self.negative(whole(values)) else values)

    def _simplex(self, values: Array, bounds: list[tuple[float, float]]) -> Array:
        corners = [values]
        for index, (low, high) in enumerate(bounds):
            moved = values.copy()
            step = 1e-3 * max(1e-3, min(1.0, abs(values[index])))
            # Inward where the bound is near: a corner cut off there would leave the simplex without extent.
            moved[index] += step if values[index] + step <= high else -step
            corners.append(np.clip(moved, low, high))
        return np.array(corners)

    def _bounds(self) -> list[tuple[float, float]]:
        x = self.trials.x
        # Wider than the three ranges that `fit_threshold` takes, so that a refusal differs from a search
        # that was held.
        low, high = float(x.min() - 5 * self.width), float(x.max() + 5 * self.width)
        if self.shape == "weibull":
            low, spread = float(x.min()) * 1e-3, (float(np.log(1e-2)), float(np.log(1e3)))
        else:
            # From a step between neighboring levels to a function that is flat over all of them.
            spread = (float(np.log(self.width * 1e-4)), float(np.log(self.width * 50)))
        return [(low, high), spread, (0.0, LAPSE_MAX)]

    def _starts(self, size: int) -> list[Array]:
        x, n = self.trials.x, self.trials.n
        # Two places and two spreads: with guesses and lapses the likelihood has further maxima at flat
        # functions.
        places = [float(np.average(x, weights=n)), float(np.quantile(x, 0.25))]
        spreads = [1.0, 4.0] if self.shape == "weibull" else [self.width / 3, self.width / 10]
        return [
            np.array([location, np.log(spread), 0.02][:size]) for location in places for spread in spreads
        ]

    def standard_error(self, best: Array) -> float | None:
        """Wald standard error of the location from the observed information; None where it has none."""
        inner = best.copy()
        if self.lapse is None and not BOUND < best[2] < LAPSE_MAX - BOUND:
            return None
        # About the fourth root of the machine's precision, where rounding and truncation of a second
        # difference are equal.
        steps = np.maximum(np.abs(inner), [self.width / 10, 1.0, 0.02][: inner.size]) * 1e-4
        size = inner.size
        information = np.zeros((size, size))
        for i in range(size):
            for j in range(size):
                one, other = np.zeros(size), np.zeros(size)
                one[i], other[j] = steps[i], steps[j]
                # The mixed second difference over four corners; with i = j it is the usual one at twice the
                # step.
                signs = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
                total = sum(sign * self.negative(inner + a * one + b * other) for a, b, sign in signs)
                information[i, j] = total / (4 * steps[i] * steps[j])
        try:
            variance = float(np.linalg.inv(information)[0, 0])
        except np.linalg.LinAlgError:
            return None
        return float(np.sqrt(variance)) if variance > 0 else None

    def profile(self, index: int, best: Array, value: float) -> Interval:
        """Where twice the loss of log-likelihood reaches the 95% quantile of chi2(1), on either side."""
        bounds = self._bounds()[index]
        step = (self.width / 20) if index == 0 else 0.1
        return Interval(
            self._end(index, best, value, -step, bounds[0]), self._end(index, best, value, step, bounds[1])
        )

    def _end(self, index: int, best: Array, value: float, step: float, bound: float) -> float | None:
        def loss(location: float) -> float:
            return 2 * (value - self.maximum({index: location}, best)[1]) - CHI2_95

        inside = float(best[index])
        while True:
            outside = inside + step
            if (outside - bound) * np.sign(step) > 0:
                outside = bound
            if loss(outside) > 0:
                return float(optimize.brentq(loss, inside, outside, xtol=1e-7 * max(1.0, self.width)))
            if outside == bound:
                return None
            # Growing steps: the end of an open profile, at a bound, is reached in a dozen fits.
            inside, step = outside, step * 1.6


# The p of a deviance against the saturated model, where enough answers repeat a condition.

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
