"""Parameters that maximise the likelihood of the cumulative-logit mixed model, and their covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from analysis.models.laplace import LaplaceLikelihood
from analysis.models.ordinal_data import OrdinalData, Parameters
from analysis.models.quadrature import QuadratureLikelihood

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]
Likelihood = LaplaceLikelihood | QuadratureLikelihood

SD_MAX = float(np.exp(4))
START_SD = 0.6
LOG_GAP_BOUNDS = (-12.0, 5.0)
"""Of the logarithms of the distances between thresholds."""

NEAR_ZERO = 0.01
"""An SD below this is tried at zero."""

LIFTS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""SDs at which one that ended at zero is tried: every likelihood is level there, at a minimum too."""

GAIN = 1e-9
"""Log-likelihoods closer than this are equal."""

NEWTON_GAIN = 1e-11
"""A Newton step that promises less than this was the last."""

HESSIAN_STEP = 1e-4
NEWTON_STEPS = 8


@dataclass(frozen=True)
class Maximum:
    """Estimates, the log-likelihood there, and the covariance of thresholds' logs, coefficients and SDs.

    SDs of zero are held fixed in `covariance`; `settled` tells whether no Newton step can gain anything.
    """

    parameters: Parameters
    value: float
    covariance: Floats
    settled: bool


def pooled_start(d: OrdinalData, with_items: bool) -> Parameters:
    """Thresholds from the pooled cumulative shares, no effects, moderate SDs; that of no items is zero."""
    shares = np.cumsum(np.bincount(d.category, minlength=d.n_categories))[:-1] / len(d.category)
    sd = np.full(d.n_sds, START_SD)
    sd[-1] *= with_items
    return Parameters(np.log(shares / (1 - shares)), np.zeros(d.x.shape[1]), sd)


def maximise(likelihood: Likelihood, start: Parameters, with_items: bool) -> Maximum:
    """Climb by L-BFGS-B, lift SDs that stuck at zero, then by Newton until no step gains anything."""
    search = _Search(likelihood, with_items)
    packed = search.zeroed(search.climbed(_pack(start)))
    for _ in range(likelihood.data.n_sds):
        lifted = search.lifted(packed)
        if lifted is None:
            break
        packed = search.zeroed(search.climbed(lifted))
    return search.polished(packed)


def _pack(p: Parameters) -> Floats:
    """First threshold, logs of the gaps between thresholds, coefficients, SDs."""
    return np.concatenate([p.thresholds[:1], np.log(np.diff(p.thresholds)), p.beta, p.sd])


def packed_gradient(gradient: Parameters, log_gaps: Floats) -> Floats:
    """Gradient by the first threshold, the logs of the gaps between thresholds, coefficients, SDs."""
    later = np.cumsum(gradient.thresholds[::-1])[::-1]
    return np.concatenate([later[:1], later[1:] * np.exp(log_gaps), gradient.beta, gradient.sd])


def newton_step(likelihood: Likelihood, maximum: Maximum) -> Floats:
    """How far the maximum of another likelihood lies from this one, by its gradient here."""
    _, gradient = likelihood.evaluate(maximum.parameters)
    log_gaps = np.log(np.diff(maximum.parameters.thresholds))
    return np.asarray(maximum.covariance @ packed_gradient(gradient, log_gaps), dtype=np.float64)


def _unpack(packed: Floats, d: OrdinalData) -> Parameters:
    k = d.n_categories - 1
    thresholds = packed[0] + np.concatenate([[0.0], np.cumsum(np.exp(packed[1:k]))])
    return Parameters(thresholds, packed[k : -d.n_sds], packed[-d.n_sds :])


class _Search:
    """The log-likelihood of packed parameters; without items their SD stays at zero."""

    def __init__(self, likelihood: Likelihood, with_items: bool) -> None:
        self.likelihood, d = likelihood, likelihood.data
        free, gap = (-np.inf, np.inf), LOG_GAP_BOUNDS
        bounds = [free] + [gap] * (d.n_categories - 2) + [free] * d.x.shape[1]
        bounds += [(0.0, SD_MAX)] * (d.n_sds - 1) + [(0.0, SD_MAX if with_items else 0.0)]
        self.low, self.high = np.array(bounds).T
        self.is_sd: Bools = np.arange(len(bounds)) >= len(bounds) - d.n_sds

    def at(self, packed: Floats) -> tuple[float, Floats]:
        """Log-likelihood and its gradient."""
        d = self.likelihood.data
        value, gradient = self.likelihood.evaluate(_unpack(packed, d))
        return value, packed_gradient(gradient, packed[1 : d.n_categories - 1])

    def climbed(self, start: Floats) -> Floats:
        """Where L-BFGS-B stops."""

        def objective(packed: Floats) -> tuple[float, Floats]:
            value, gradient = self.at(packed)
            return -value, -gradient

        optimum = optimize.minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(self.low, self.high, strict=True)),
            options={"maxiter": 2000, "maxfun": 4000, "ftol": 1e-13, "gtol": 1e-5, "maxcor": 30},
        )
        return np.asarray(optimum.x, dtype=np.float64)

    def zeroed(self, packed: Floats) -> Floats:
        """Tiny SDs put at zero where that loses nothing."""
        for k in np.flatnonzero(self.is_sd & (packed > 0) & (packed < NEAR_ZERO)):
            trial = packed.copy()
            trial[k] = 0.0
            if self.at(trial)[0] >= self.at(packed)[0] - GAIN:
                packed = trial
        return packed

    def lifted(self, packed: Floats) -> Floats | None:
        """With one SD lifted from zero where that gains, else None."""
        value = self.at(packed)[0]
        for k in np.flatnonzero(self.is_sd & (packed == 0) & (self.high > 0)):
            trials = np.repeat(packed[None], len(LIFTS), axis=0)
            trials[:, k] = LIFTS
            values = [self.at(trial)[0] for trial in trials]
            if max(values) > value + GAIN:
                return np.asarray(trials[int(np.argmax(values))], dtype=np.float64)
        return None

    def polished(self, packed: Floats) -> Maximum:
        """Newton steps while they gain; the last information matrix gives the covariance."""
        for left in reversed(range(NEWTON_STEPS)):
            value, gradient = self.at(packed)
            free = np.flatnonzero(~(self.is_sd & (packed == 0)))
            information = self._information(packed, free)
            inside = (packed > self.low)[free] & (packed < self.high)[free]
            step = _newton_step(information[np.ix_(inside, inside)], gradient[free][inside])
            gain = 0.0 if step is None else float(step @ gradient[free][inside]) / 2
            if left == 0 or step is None or gain < NEWTON_GAIN:
                break
            higher = self._stepped(packed, free[inside], step, value)
            if higher is None:
                break
            packed = higher
        covariance = np.zeros((len(packed), len(packed)))
        covariance[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True)
        settled = step is not None and gain < GAIN
        return Maximum(_unpack(packed, self.likelihood.data), value, covariance, settled)

    def _stepped(self, packed: Floats, free: Integers, step: Floats, value: float) -> Floats | None:
        """A Newton step, halved until the likelihood rises, within the bounds."""
        for halvings in range(5):
            trial = packed.copy()
            trial[free] += step / 2**halvings
            trial = np.clip(trial, self.low, self.high)
            if self.at(trial)[0] > value:
                return trial
        return None

    def _information(self, packed: Floats, free: Integers) -> Floats:
        """Observed information of the free parameters, from central differences of the exact gradient."""
        rows = []
        for k in free:
            move = HESSIAN_STEP * np.eye(len(packed))[k]
            rows.append((self.at(packed - move)[1] - self.at(packed + move)[1])[free] / (2 * HESSIAN_STEP))
        information = np.stack(rows)
        return np.asarray((information + information.T) / 2)


def _newton_step(information: Floats, gradient: Floats) -> Floats | None:
    """Where a quadratic likelihood has its maximum; None where this one is no such hill."""
    values, vectors = np.linalg.eigh(information)
    if values.min() <= 0:
        return None
    return np.asarray(vectors @ ((vectors.T @ gradient) / values))
