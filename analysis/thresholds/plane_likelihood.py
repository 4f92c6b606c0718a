"""The likelihood of a psychometric function of two stimulus variables, from counted trials."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.thresholds.likelihood import normal_density

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
    """The likelihood of eq. (1) in the predictor X beta + offset, maximised by Fisher scoring."""

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
            step: Array = np.asarray(np.linalg.lstsq(information, score, rcond=None)[0], dtype=np.float64)
            beta, value, gained = self._stepped(x, offset, beta, step, value)
            if gained < TOLERANCE * (1 + abs(value)):
                break
        return beta, value, information

    def _stepped(
        self, x: Array, offset: Array | float, beta: Array, step: Array, before: float
    ) -> tuple[Array, float, float]:
        """The step, halved until the likelihood rises."""
        for halving in range(40):
            moved = beta + step * 0.5**halving
            value = self.value(x @ moved + offset)
            if value >= before:
                return moved, value, value - before
        return beta, before, 0.0

    def start(self, x: Array) -> Array:
        """Least squares on smoothed shares, put back on the predictor's scale."""
        share = ((self.k + 0.5) / (self.n + 1) - self.guess) / self.scale
        share = np.clip(share, 0.02, 0.98)
        eta = special.ndtri(share) if self.shape == "normal" else special.logit(share)
        root = np.sqrt(self.n)[:, None]
        return np.asarray(np.linalg.lstsq(x * root, eta * root[:, 0], rcond=None)[0])

    def steepest(self, beta: Array, x: Array) -> float:
        """The greatest dP/d eta at a stimulus."""
        return float(self._share(x @ beta)[1].max()) / self.scale

    def deviance(self, beta: Array, x: Array) -> float:
        """Twice what the saturated model gains."""
        p, _ = self._share(x @ beta)
        yes, no = self.k, self.n - self.k
        terms = special.xlogy(yes, yes / (self.n * p)) + special.xlogy(no, no / (self.n * (1 - p)))
        return float(2 * terms.sum())
