"""The psychometric function: fitted by maximum likelihood, with profile likelihood intervals."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from experiments.errors import InputError

Array = NDArray[np.float64]
Shape = Literal["normal", "logistic", "weibull"]
LAPSE_MAX = 0.1
CHI2_95 = float(stats.chi2.ppf(0.95, 1))
BOUND = 1e-9


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


@dataclass(frozen=True)
class Threshold:
    """A fitted psychometric function.

    Attributes
    ----------
    threshold : float
        Where F is one half: the underlying F50, in the unit of x.
    threshold_total : float or None
        Where the whole function passes the middle between guess and 1 - lapse: the same x; and `x75`, where
        the whole function is .75 (None where it never is).
    slope : float
        dF/dx at the threshold, in 1 / unit of x; `spread` is the SD (normal), scale (logistic) or exponent
        (weibull).
    """

    shape: Shape
    guess: float
    lapse: float
    lapse_fitted: bool
    threshold: float
    threshold_se: float | None
    threshold_ci: Interval
    spread: float
    spread_ci: Interval
    slope: float
    x75: float | None
    log_likelihood: float
    deviance: float
    df: int
    p: float
    n_trials: int
    n_levels: int
    falling: bool
    notes: tuple[str, ...]


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
            power = np.exp(np.minimum(b * (np.log(x) - np.log(location)), 700.0))
        return np.asarray(-np.expm1(-np.log(2.0) * power))
    z = (x - location) / b
    return np.asarray(special.ndtr(z) if shape == "normal" else special.expit(z))


def fit_threshold(
    trials: Trials,
    shape: Shape = "normal",
    guess: float = 0.0,
    lapse: float | None = 0.0,
    *,
    intervals: bool = True,
) -> Threshold:
    r"""Fit P(x) = guess + (1 - guess - lapse) F(x) by maximum likelihood.

    Parameters
    ----------
    trials : Trials
    shape : {"normal", "logistic", "weibull"}
    guess : float
        Lower asymptote: 0 for yes/no, 1 / m for m-alternative forced choice.
    lapse : float or None
        Upper asymptote is 1 - lapse; None fits it, between 0 and 0.1.
    intervals : bool
        Whether to profile the likelihood for intervals: every other parameter is fitted anew at each value.

    Raises
    ------
    InputError
        Too few levels, answers all alike, an answer that does not change with x, a threshold far outside.
    """
    refuse_unfit(trials, shape)
    model = _Likelihood(trials, shape, guess, lapse)
    best, value = model.maximum({})
    location, log_spread = best[0], best[1]
    lapsed = best[2] if lapse is None else lapse
    notes = _doubts(trials, location, log_spread, shape, lapsed, lapse is None)
    low, high = float(trials.x.min()), float(trials.x.max())
    if not low - 3 * (high - low) <= location <= high + 3 * (high - low):
        raise InputError(
            f"the threshold lies far outside what was shown ({low:g} to {high:g}); the answers hardly change with x"
        )
    expected = model.probabilities(best)
    deviance, df = _deviance(trials, expected), trials.x.size - len(best)
    empty = Interval(None, None)
    location_ci = model.profile(0, best, value) if intervals else empty
    spread_ci = model.profile(1, best, value) if intervals else empty
    return Threshold(
        shape,
        guess,
        float(lapsed),
        lapse is None,
        float(location),
        model.standard_error(best) if lapsed > BOUND or lapse is not None else None,
        location_ci,
        float(np.exp(log_spread)),
        Interval(*(None if end is None else float(np.exp(end)) for end in (spread_ci.low, spread_ci.high))),
        _slope(shape, location, log_spread) * (-1.0 if model.falling else 1.0),
        _level(model, best, 0.75),
        float(value),
        deviance,
        df,
        float(stats.chi2.sf(deviance, df)) if df > 0 else float("nan"),
        int(trials.n.sum()),
        trials.x.size,
        model.falling,
        tuple(notes),
    )


def refuse_unfit(trials: Trials, shape: Shape) -> None:
    """Refuse data on which no function can be placed."""
    if trials.x.size < 2:
        raise InputError(f"expected answers at two levels of x or more, got {trials.x.size}")
    share = trials.k.sum() / trials.n.sum()
    if share in (0.0, 1.0):
        raise InputError(
            f"all {int(trials.n.sum())} answers are alike; there is no threshold among these levels"
        )
    if shape == "weibull" and trials.x.min() <= 0:
        raise InputError(
            f"the Weibull function needs x above 0, got {trials.x.min():g}; use --function normal"
        )


class _Likelihood:
    """The likelihood of one data set; parameters are location, log spread and, if fitted, lapse."""

    def __init__(self, trials: Trials, shape: Shape, guess: float, lapse: float | None) -> None:
        self.trials, self.shape, self.guess, self.lapse = trials, shape, guess, lapse
        centred = trials.x - np.average(trials.x, weights=trials.n)
        self.falling = guess == 0.0 and float(np.sum(centred * trials.k)) < 0
        self.width = float(trials.x.max() - trials.x.min())

    def probabilities(self, values: Array) -> Array:
        lapse = values[2] if self.lapse is None else self.lapse
        rising = function(self.shape, self.trials.x, values[0], values[1])
        f = 1.0 - rising if self.falling else rising
        return np.asarray(np.clip(self.guess + (1 - self.guess - lapse) * f, 1e-12, 1 - 1e-12))

    def negative(self, values: Array) -> float:
        p = self.probabilities(values)
        return -float(self.trials.k @ np.log(p) + (self.trials.n - self.trials.k) @ np.log1p(-p))

    def maximum(self, held: dict[int, float], start: Array | None = None) -> tuple[Array, float]:
        """Maximise over the parameters that are not `held`; return them all and the log-likelihood."""
        size = 3 if self.lapse is None else 2
        free = [index for index in range(size) if index not in held]

        def whole(values: Array) -> Array:
            full = np.zeros(size)
            full[free] = values
            for index, value in held.items():
                full[index] = value
            return full

        starts = [start] if start is not None else self._starts(size)
        bounds = [self._bounds()[index] for index in free]
        fits = [
            optimize.minimize(
                lambda values: self.negative(whole(values)),
                np.clip(one[free], [low for low, _ in bounds], [high for _, high in bounds]),
                method="L-BFGS-B",
                bounds=bounds,
                options={"ftol": 1e-15, "gtol": 1e-9, "maxiter": 500},
            )
            for one in starts
        ]
        best = min(fits, key=lambda fit: float(fit.fun))
        polished = self._polished(whole, best.x, bounds)
        return whole(polished), -self.negative(whole(polished))

    def _polished(
        self, whole: Callable[[Array], Array], values: Array, bounds: list[tuple[float, float]]
    ) -> Array:
        """Refine by the simplex method: the quasi-Newton steps end at the noise of their differences."""
        if not values.size:
            return values
        fit = optimize.minimize(
            lambda inner: self.negative(whole(inner)),
            values,
            method="Nelder-Mead",
            bounds=bounds,
            options={
                "xatol": 1e-10,
                "fatol": 1e-13,
                "maxiter": 2000,
                "initial_simplex": self._simplex(values, bounds),
            },
        )
        return np.asarray(fit.x if fit.fun <= self.negative(whole(values)) else values)

    def _simplex(self, values: Array, bounds: list[tuple[float, float]]) -> Array:
        corners = [values]
        for index, (low, high) in enumerate(bounds):
            moved = values.copy()
            step = 1e-3 * max(1e-3, min(1.0, abs(values[index])))
            moved[index] += step if values[index] + step <= high else -step
            corners.append(np.clip(moved, low, high))
        return np.array(corners)

    def _bounds(self) -> list[tuple[float, float]]:
        x = self.trials.x
        low, high = float(x.min() - 5 * self.width), float(x.max() + 5 * self.width)
        if self.shape == "weibull":
            low, spread = float(x.min()) * 1e-3, (float(np.log(1e-2)), float(np.log(1e3)))
        else:
            spread = (float(np.log(self.width * 1e-4)), float(np.log(self.width * 50)))
        return [(low, high), spread, (0.0, LAPSE_MAX)]

    def _starts(self, size: int) -> list[Array]:
        x, n = self.trials.x, self.trials.n
        places = [float(np.average(x, weights=n)), *np.quantile(x, [0.25, 0.5, 0.75]).tolist()]
        spreads = [1.0, 4.0] if self.shape == "weibull" else [self.width / 3, self.width / 10]
        return [np.array([place, np.log(spread), 0.02][:size]) for place in places for spread in spreads]

    def standard_error(self, best: Array) -> float | None:
        """Wald standard error of the location from the observed information; None where it has none."""
        inner = best.copy()
        if self.lapse is None and not BOUND < best[2] < LAPSE_MAX - BOUND:
            return None
        steps = np.maximum(np.abs(inner), [self.width / 10, 1.0, 0.02][: inner.size]) * 1e-4
        size = inner.size
        information = np.zeros((size, size))
        for i in range(size):
            for j in range(size):
                one, other = np.zeros(size), np.zeros(size)
                one[i], other[j] = steps[i], steps[j]
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
        def loss(place: float) -> float:
            return 2 * (value - self.maximum({index: place}, best)[1]) - CHI2_95

        inside = float(best[index])
        while True:
            outside = inside + step
            if (outside - bound) * np.sign(step) > 0:
                return None
            if loss(outside) > 0:
                return float(optimize.brentq(loss, inside, outside, xtol=1e-9 * max(1.0, self.width)))
            inside, step = outside, step * 1.6


def _slope(shape: Shape, location: float, log_spread: float) -> float:
    b = float(np.exp(log_spread))
    if shape == "normal":
        return 1.0 / (b * float(np.sqrt(2 * np.pi)))
    return 1.0 / (4 * b) if shape == "logistic" else float(np.log(2) / 2) * b / location


def _level(model: _Likelihood, best: Array, level: float) -> float | None:
    """Return the x at which the whole function is `level`; None where its asymptotes leave it out."""
    lapse = best[2] if model.lapse is None else model.lapse
    f = (level - model.guess) / (1 - model.guess - lapse)
    if not 0 < f < 1:
        return None
    f = 1 - f if model.falling else f
    location, b = float(best[0]), float(np.exp(best[1]))
    if model.shape == "weibull":
        return location * float((-np.log2(1 - f)) ** (1 / b))
    return location + b * float(special.ndtri(f) if model.shape == "normal" else special.logit(f))


def _deviance(trials: Trials, p: Array) -> float:
    yes, no = trials.k, trials.n - trials.k
    terms = special.xlogy(yes, yes / (trials.n * p)) + special.xlogy(no, no / (trials.n * (1 - p)))
    return float(2 * terms.sum())


def _doubts(
    trials: Trials, location: float, log_spread: float, shape: Shape, lapse: float, fitted: bool
) -> list[str]:
    notes = []
    if not trials.x.min() <= location <= trials.x.max():
        notes.append(f"the threshold {location:.4g} lies outside the levels shown: extrapolated")
    shares = trials.k / trials.n
    if np.all((shares == 0) | (shares == 1)):
        notes.append("the answers switch between two levels: the slope has no upper limit")
    if fitted and lapse <= BOUND:
        notes.append("the lapse rate is estimated at its bound 0")
    if fitted and lapse >= LAPSE_MAX - BOUND:
        notes.append(f"the lapse rate is estimated at its bound {LAPSE_MAX:g}")
    if shape != "weibull" and np.exp(log_spread) > 10 * (trials.x.max() - trials.x.min()):
        notes.append("the answers hardly change over the levels shown")
    return notes
