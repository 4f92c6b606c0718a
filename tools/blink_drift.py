"""Intervals between blinks as a law that drifts: fitted by maximum likelihood, and what the fit leaves open.

With l_k the logarithm of interval k,

    l_k = mu + d_k + e_k                                (1)
    d_k = phi d_(k-1) + sqrt(1 - phi^2) w z_k           (2)

e_k: the logarithm of a gamma or log-normal number (`blink_engine.laws.Law`), its mean taken away; z_k
standard normal; w and phi are the drift's spread and what is kept of it (`blink_engine.parameters.Drift`). A
slow drift, another d with its own w and phi, is not fitted: its size over an hour is published.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import optimize, special

Array = npt.NDArray[np.float64]
Kind = Literal["gamma", "lognormal"]
GRID = 61
GRID_SPREADS = 4.0
REFERENCE = 40_000


@dataclass(frozen=True)
class IntervalFit:
    """The law's kind and spread (gamma: its shape), mu, w and phi of equations 1 and 2, and the likelihood.

    Attributes
    ----------
    slow_spread, slow_kept : float
        w and phi of the slow drift.
    """

    kind: Kind
    spread: float
    location: float
    drift: float
    kept: float
    log_likelihood: float = 0.0
    slow_spread: float = 0.0
    slow_kept: float = 0.0

    def sample(self, count: int, times: int, rng: np.random.Generator) -> Array:
        """Logarithms of intervals (times, count), each row a recording of its own."""
        size = (times, count)
        if self.kind == "gamma":
            own = np.log(rng.gamma(self.spread, 1.0, size)) - special.digamma(self.spread)
        else:
            own = rng.normal(0.0, self.spread, size)
        drift = _wandering(self.drift, self.kept, count, times, rng)
        return self.location + own + drift + _wandering(self.slow_spread, self.slow_kept, count, times, rng)


def _wandering(spread: float, kept: float, count: int, times: int, rng: np.random.Generator) -> Array:
    """Courses of d by equation 2, (times, count)."""
    course = np.empty((times, count))
    course[:, 0] = rng.normal(0.0, spread, times)
    step = spread * np.sqrt(1.0 - kept**2)
    for k in range(1, count):
        course[:, k] = kept * course[:, k - 1] + rng.normal(0.0, step, times)
    return course


def fit_intervals(intervals_s: Array, kind: Kind = "gamma", drifts: bool = True) -> IntervalFit:
    """Fit equations 1 and 2 to intervals (n,) in their order; without `drifts` equation 1 with d = 0."""
    logs = np.log(intervals_s)

    def natural(values: Array) -> IntervalFit:
        location, spread, drift, kept = (float(value) for value in values)
        return IntervalFit(
            kind, np.exp(spread), location, np.exp(drift) if drifts else 1e-3, special.expit(kept)
        )

    def loss(values: Array) -> float:
        fit = natural(values)
        sensible = fit.drift < 3.0 and fit.kept < 0.9995
        return -_log_likelihood(logs, fit) if sensible else 1e9

    first = np.log(3.0 if kind == "gamma" else 0.6)
    starts = [np.array([logs.mean(), first, np.log(0.5), kept]) for kept in (1.0, 3.0)]
    fits = [
        optimize.minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
        for start in starts
    ]
    best = min(fits, key=lambda one: float(one.fun))
    return replace(natural(best.x), log_likelihood=-float(best.fun))


def _density(fit: IntervalFit) -> Callable[[Array], Array]:
    """Density of l_k - d_k."""
    if fit.kind == "lognormal":
        scale = fit.spread * np.sqrt(2.0 * np.pi)
        return lambda logs: np.exp(-0.5 * ((logs - fit.location) / fit.spread) ** 2) / scale
    shape, centre = fit.spread, fit.location - special.digamma(fit.spread)
    return lambda logs: np.exp(
        shape * (logs - centre) - np.exp(np.minimum(logs - centre, 50.0)) - special.gammaln(shape)
    )


def _log_likelihood(logs: Array, fit: IntervalFit) -> float:
    """By a filter over a grid of d: `weights` (GRID,) are the probabilities of d_k, given l_1 to l_(k-1)."""
    grid = np.linspace(-GRID_SPREADS, GRID_SPREADS, GRID) * fit.drift
    step = fit.drift * np.sqrt(1.0 - fit.kept**2)
    moves = np.exp(-0.5 * ((grid[None, :] - fit.kept * grid[:, None]) / step) ** 2)
    moves /= moves.sum(axis=1, keepdims=True)
    weights = np.exp(-0.5 * (grid / fit.drift) ** 2)
    weights /= weights.sum()
    likelihoods = np.maximum(_density(fit)(logs[:, None] - grid[None, :]), 1e-300)
    total = 0.0
    for likelihood in likelihoods:
        joint = weights * likelihood
        seen = joint.sum()
        total += np.log(seen)
        weights = (joint / seen) @ moves
    return float(total)


def held_out_p(fit: IntervalFit, fitted_s: Array, kept_s: Array, times: int = 2000, seed: int = 1) -> float:
    """How often one half of a recording that the fit draws lies as far from the other as these two.

    The distance is Kolmogorov's, of the half kept out about the fitted law, laid on the fitted half's mean.
    The usual table of p takes intervals for independent of each other and the mean for known. Neither holds:
    ten minutes hold few stretches of many and of few blinks, so that the mean of ten minutes says less than
    their number of blinks suggests. Here both halves are drawn in one, again and again.
    """
    count, rng = fitted_s.size, np.random.default_rng(seed)
    law = np.sort(fit.sample(1, REFERENCE, rng).ravel() - fit.location)

    def distances(logs: Array) -> Array:
        means = logs[:, :count].mean(axis=1, keepdims=True)
        shares = np.searchsorted(law, np.sort(logs[:, count:], axis=1) - means) / REFERENCE
        steps = np.arange(kept_s.size + 1) / kept_s.size
        return np.asarray(np.maximum(shares - steps[:-1], steps[1:] - shares).max(axis=1))

    drawn = fit.sample(count + kept_s.size, times, rng)
    seen = distances(np.log(np.concatenate([fitted_s, kept_s]))[None, :])
    return float(np.mean(distances(drawn) >= seen))


def with_slow_drift(fit: IntervalFit, kept: float, rate: float, variation: float) -> IntervalFit:
    """Add a slow drift with which an hour's bins of 5 minutes vary as much as was published.

    Parameters
    ----------
    rate : float
        Blinks a minute of the people in that study.
    variation : float
        Their coefficient of variation.
    """

    def miss(spread: float) -> float:
        return bins_variation(replace(fit, slow_spread=spread, slow_kept=kept), rate) - variation

    if miss(0.0) >= 0.0:
        return replace(fit, slow_kept=kept)
    return replace(fit, slow_spread=float(optimize.brentq(miss, 0.0, 1.0, xtol=1e-3)), slow_kept=kept)


def bins_variation(fit: IntervalFit, rate: float, times: int = 400) -> float:
    """Coefficient of variation of the blinks in twelve bins of 5 minutes, mean over so many hours.

    `rate` in blinks a minute is the long-term mean, whatever the fit's location.
    """
    intervals = np.exp(fit.sample(int(60 * rate * 2.5), times, np.random.default_rng(2)))
    onsets = np.cumsum(intervals * 60.0 / rate / intervals.mean(), axis=1)
    bins = np.array([np.histogram(row, bins=np.arange(0, 3601, 300))[0] for row in onsets])
    return float(np.mean(bins.std(axis=1, ddof=1) / bins.mean(axis=1)))
