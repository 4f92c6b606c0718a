"""A psychometric function of two stimulus variables: its threshold is a straight line over the second."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from analysis.thresholds.likelihood import CHI2_95, Interval, fit_p, normal_density
from experiments.errors import InputError

# The likelihood of a psychometric function of two stimulus variables, from counted trials.

Array = NDArray[np.float64]


PlaneShape = Literal["normal", "logistic"]


MAX_STEPS, TOLERANCE = 100, 1e-15


class Points(NamedTuple):
    """Trials counted by stimulus: x and z (m,), trials n (m,), positive (or correct) answers k (m,)."""

    x: Array
    z: Array
    n: Array
    k: Array


def counted_points(x: Array, z: Array, response: Array) -> Points:
    """Count trials and positive answers at each stimulus."""
    places, index = np.unique(np.column_stack([x, z]), axis=0, return_inverse=True)
    n = np.bincount(index.ravel(), minlength=len(places)).astype(float)
    k = np.asarray(np.bincount(index.ravel(), weights=response, minlength=len(places)), dtype=np.float64)
    return Points(places[:, 0], places[:, 1], n, k)


class PlaneLikelihood:
    """The likelihood of eq. (1) in the predictor X beta + offset, maximized by Fisher scoring."""

    def __init__(self, points: Points, shape: PlaneShape, guess: float, lapse: float) -> None:
        self.n, self.k, self.shape = points.n, points.k, shape
        self.guess, self.scale = guess, 1 - guess - lapse

    def _share(self, eta: Array) -> tuple[Array, Array]:
        """P and dP/d eta."""
        if self.shape == "normal":
            f, slope = special.ndtr(eta), normal_density(eta)
        else:
            f = special.expit(eta)
            slope = f * special.expit(-eta)
        return np.clip(self.guess + self.scale * f, 1e-12, 1 - 1e-12), self.scale * slope

    def value(self, eta: Array) -> float:
        """The log-likelihood, without its binomial coefficients."""
        p, _ = self._share(eta)
        return float(special.xlogy(self.k, p).sum() + special.xlog1py(self.n - self.k, -p).sum())

    def best(
        self, x: Array, starts: Sequence[Array], offset: Array | float = 0.0
    ) -> tuple[Array, float, Array]:
        """The best of the maxima that these starts lead to."""
        return max((self.fit(x, start, offset) for start in starts), key=lambda fit: fit[1])

    def fit(self, x: Array, start: Array, offset: Array | float = 0.0) -> tuple[Array, float, Array]:
        """A maximum over beta, its log-likelihood and the expected information (p, p)."""
        beta = start
        value = self.value(x @ beta + offset)
        information = np.eye(x.shape[1])
        for _ in range(MAX_STEPS):
            p, slope = self._share(x @ beta + offset)
            variance = p * (1 - p)
            information = x.T @ (x * (self.n * slope**2 / variance)[:, None])
            score = x.T @ ((self.k - self.n * p) / variance * slope)
            # Least squares, as the information of a step-like function is singular to rounding on its way
            # to the maximum.
            step: Array = np.asarray(np.linalg.lstsq(information, score, rcond=None)[0], dtype=np.float64)
            beta, value, gained = self._stepped(x, offset, beta, step, value)
            if gained < TOLERANCE * (1 + abs(value)):
                break
        return beta, value, information

    def _stepped(
        self, x: Array, offset: Array | float, beta: Array, step: Array, before: float
    ) -> tuple[Array, float, float]:
        """The step, halved until the likelihood rises."""
        # Scoring may overshoot where guesses make the likelihood not concave; 2^-40 of a step is none.
        for halving in range(40):
            moved = beta + step * 0.5**halving
            value = self.value(x @ moved + offset)
            if value >= before:
                return moved, value, value - before
        return beta, before, 0.0

    def start(self, x: Array) -> Array:
        """Least squares on smoothed shares, put back on the predictor's scale."""
        # Half an answer of either kind: shares of 0 and 1 have no finite predictor.
        share = ((self.k + 0.5) / (self.n + 1) - self.guess) / self.scale
        share = np.clip(share, 0.02, 0.98)
        eta = special.ndtri(share) if self.shape == "normal" else special.logit(share)
        root = np.sqrt(self.n)[:, None]
        return np.asarray(np.linalg.lstsq(x * root, eta * root[:, 0], rcond=None)[0])

    def steepest(self, beta: Array, x: Array) -> float:
        """The greatest dP/d eta at a stimulus."""
        # Of F itself: guesses and lapses flatten P, and say nothing of overlap.
        return float(self._share(x @ beta)[1].max()) / self.scale

    def deviance(self, beta: Array, x: Array) -> float:
        """Twice what the saturated model gains."""
        p, _ = self._share(x @ beta)
        yes, no = self.k, self.n - self.k
        terms = special.xlogy(yes, yes / (self.n * p)) + special.xlogy(no, no / (self.n * (1 - p)))
        return float(2 * terms.sum())


# Profile likelihood intervals of a psychometric function of two stimulus variables.

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
        """The interval of the threshold at z = `at`: b1 (x - t) + b2 (z - at)."""

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
        """x / s is an offset in addition to b0 + b2 z; searched by the logarithm."""

        def loss(log_s: float) -> float:
            columns = np.column_stack([np.ones_like(self.x), self.z])
            s = float(np.exp(log_s))
            starts = [(self.best[0], self.best[2]), (-float(self.x.mean()) / s, 0.0)]
            return self._loss(columns, starts, self.x / s)

        ends = self._ends(loss, float(np.log(best)), 0.1, 8.0)
        return ends.changed(lambda end: float(np.exp(end)))

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


FLATTEST = 1e-4
"""Where F rises less than this at every stimulus shown, the answers switch without overlap."""
MAX_CONDITION = 1e16


@dataclass(frozen=True)
class LinePoint:
    """The threshold at one number of the second variable."""

    z: float
    threshold: float
    ci: Interval


@dataclass(frozen=True)
class Plane:
    """A fitted function of two variables; see `fit_plane`.

    Attributes
    ----------
    threshold : float
        At z = `middle`, in the unit of x.
    tilt : float
        Change of the threshold per unit of z.
    spread : float
        SD (normal) or scale (logistic) along x.
    line : tuple of LinePoint
        The threshold at every z that was shown, with its profile likelihood interval.
    p : float
        Of the deviance against chi2 with `df`: small where the line or the shape does not hold.
    """

    shape: PlaneShape
    guess: float
    lapse: float
    middle: float
    threshold: float
    threshold_se: float
    threshold_ci: Interval
    tilt: float
    tilt_se: float
    tilt_ci: Interval
    spread: float
    spread_ci: Interval
    line: tuple[LinePoint, ...]
    log_likelihood: float
    deviance: float
    df: int
    p: float
    n_trials: int
    n_points: int
    falling: bool


def fit_plane(
    points: Points,
    shape: PlaneShape = "normal",
    guess: float = 0.0,
    lapse: float = 0.0,
    *,
    falling: bool = False,
    middle: float | None = None,
    along: bool = True,
) -> Plane:
    r"""Fit a threshold that is a straight line over z, by maximum likelihood.

    .. math::

        P(x, z) = \gamma + (1 - \gamma - \lambda) F\left(\frac{x - t - b (z - z_0)}{s}\right) \tag{1}

    with guess rate gamma, lapse rate lambda, threshold t at z_0, tilt b and spread s. With gamma = lambda = 0
    this is a probit (logit) regression on x and z. Intervals are profiles of the likelihood: every other
    parameter is fitted again at each value.

    Parameters
    ----------
    points : Points
    shape : {"normal", "logistic"}
    guess, lapse : float
        The function's ends.
    falling : bool
        Whether positive answers become rarer with x; F is then 1 - F.
    middle : float, optional
        z_0; where not given, between the lowest and the highest z.
    along : bool
        Whether to give the threshold at every z, with its interval.

    Raises
    ------
    InputError
        Fewer than two numbers of either variable, answers all alike, that do not change with x, or that
        switch without overlap.
    """
    _refuse_unfit(points)
    if middle is None:
        middle = float(points.z.min() + points.z.max()) / 2
    sign = -1.0 if falling else 1.0
    link = PlaneLikelihood(points, shape, guess, lapse)
    x, away = sign * points.x, points.z - middle
    width = float(np.ptp(points.x))
    columns = np.column_stack([np.ones_like(x), x, away])
    beta, value, information = link.best(columns, [link.start(columns), *_broad(x, width)])
    # Falling functions were turned round above: a slope of the other sign contradicts the declared
    # direction.
    if not beta[1] > 1e-6 / width:
        raise InputError(
            "the answers do not change with x in the expected direction, so there is no threshold"
        )
    if link.steepest(beta, columns) < FLATTEST or np.linalg.cond(information) > MAX_CONDITION:
        raise InputError(
            "the answers switch between stimuli without overlap; tilt and spread have no estimate"
        )
    threshold, tilt, spread = -beta[0] / beta[1], -beta[2] / beta[1], 1 / beta[1]
    covariance = np.linalg.inv(information)
    # The delta method: t = -b0 / b1 and tilt = -b2 / b1, differentiated by (b0, b1, b2) with spread = 1 /
    # b1.
    gradients = np.array([[-spread, -threshold * spread, 0.0], [0.0, -tilt * spread, -spread]])
    errors = np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients))
    # The profiles count z from 0 and not from the middle, which moves the constant.
    profile = PlaneProfiles(link, x, points.z, value, (float(beta[0] - beta[2] * middle), beta[1], beta[2]))
    deviance, df = link.deviance(beta, columns), points.n.size - 3
    line = tuple(
        LinePoint(
            float(z),
            float(sign * (threshold + tilt * (z - middle))),
            _turned(profile.threshold(threshold + tilt * (z - middle), z), sign),
        )
        for z in (np.unique(points.z) if along else ())
    )
    return Plane(
        shape,
        guess,
        lapse,
        middle,
        float(sign * threshold),
        float(errors[0]),
        _turned(profile.threshold(threshold, middle), sign),
        float(sign * tilt),
        float(errors[1]),
        _turned(profile.tilt(tilt), sign),
        float(spread),
        profile.spread(spread),
        line,
        value,
        deviance,
        df,
        fit_p(deviance, df, points.n),
        int(points.n.sum()),
        points.n.size,
        falling,
    )


def _refuse_unfit(points: Points) -> None:
    for name, values in (("x", points.x), ("the second variable", points.z)):
        if np.unique(values).size < 2:
            raise InputError(
                f"expected answers at two numbers of {name} or more, got {np.unique(values).size}"
            )
    if points.k.sum() in (0.0, points.n.sum()):
        raise InputError(
            f"all {int(points.n.sum())} answers are the same; there is no threshold among these stimuli"
        )


def _broad(x: Array, width: float) -> list[Array]:
    """Functions of these spreads about the middle of x, without a tilt."""
    return [np.array([-x.mean(), 1.0, 0.0]) / (share * width) for share in BROAD]


def _turned(interval: Interval, sign: float) -> Interval:
    if sign > 0:
        return interval
    # A change of sign turns the ends about.
    low, high = interval.high, interval.low
    return Interval(None if low is None else -low, None if high is None else -high)
