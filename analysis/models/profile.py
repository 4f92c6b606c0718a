"""Profile likelihood intervals of a linear mixed model's coefficients and standard deviations."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from analysis.models.columns import Units
from analysis.models.random_part import MixedResult
from analysis.models.reml import Criterion, CrossProducts, criterion

# Profile likelihood intervals of a linear mixed model: of coefficients, and of standard deviations.
#
# As lme4's `confint(method = "profile")`: maximum likelihood, every other parameter fitted again at each
# point (Bates et al. 2015, doi:10.18637/jss.v067.i01, section 5.1); the ends are solved for, where lme4
# interpolates.

Floats = NDArray[np.float64]
Bound = tuple[float | None, float | None]
Fit = tuple[Floats, float]
"""Where a deviance is least, and how much it is there."""
FitAt = Callable[[float, Sequence[Floats]], Fit]
"""The fit with the profiled parameter at a value, from the best of some starts."""

TOLERANCE = 1e-6
"""Relative precision of an end, in units of the distance from the estimate."""

MAX_RESTARTS = 6
SETTLED = 1e-7
"""L-BFGS, which may stop early or at zero, starts again until the deviance falls by less than this."""

LIFT = 0.05
"""Relative standard deviations start at this at least."""

START_APART = 0.5
"""Relative standard deviation of the second start of every minimum: the deviance may have two."""

SLACK = 1e-5
"""By how much less the deviance may have risen at an end from other starts."""

MAX_DOUBLINGS = 12
"""How often the bracket of an end is widened before the end counts as not there."""


class Profile:
    r"""Intervals of one model; an end that the likelihood does not have is NaN.

    Parameters
    ----------
    c : CrossProducts
    start : (m,) array
        Relative standard deviations to start from, such as the REML estimate.
    confidence : float
        Coverage.

    Notes
    -----
    With :math:`d(\psi)` the deviance (-2 log likelihood) minimized over everything but :math:`\psi`, an end
    solves :math:`d(\psi) - d(\hat\psi) = \chi^2_{1; confidence}`. For a standard deviation
    :math:`s = \sigma\theta_k` the deviance is
    :math:`\log|V| + n \log 2\pi\sigma^2 + r^2 / \sigma^2` with :math:`\theta_k = s / \sigma`; for a
    coefficient b its column leaves X and y becomes :math:`y - b x`.
    """

    def __init__(self, c: CrossProducts, start: Floats, confidence: float = 0.95) -> None:
        self._c = c
        self._bounds: list[Bound] = [
            (0.0, None) if np.trace(pattern) > 0 else (None, None)
            for block in c.blocks
            for pattern in block.patterns
        ]
        self._rise = float(special.chdtri(1, 1 - confidence))
        self._reach = float(np.sqrt(self._rise))
        self._theta, self._least = self._fitted(c, (start, self._apart()))
        self._best = criterion(c, self._theta, reml=False)

    def coefficient(self, column: int) -> tuple[float, float]:
        """Interval of the fixed coefficient of a column of X."""
        estimate = float(self._best.beta[column])
        se = self._best.sigma * float(np.sqrt(self._best.unscaled[column, column]))

        def fit(value: float, starts: Sequence[Floats]) -> Fit:
            return self._fitted(_without(self._c, column, value), starts)

        starts = (self._theta, self._apart())
        return self._end(fit, starts, estimate, -se), self._end(fit, starts, estimate, se)

    def chi2_without(self, columns: NDArray[np.int64]) -> float:
        """By how much the deviance rises when the coefficients of some columns of X are zero."""
        smaller = _without(self._c, columns, 0.0)
        return self._fitted(smaller, (self._theta, self._apart()))[1] - self._least

    def sigma(self) -> tuple[float, float]:
        """Interval of the residual standard deviation."""
        estimate = self._best.sigma
        # The asymptotic standard error of a standard deviation: only the first step of the search.
        se = estimate / np.sqrt(2 * self._c.n)

        def fit(value: float, starts: Sequence[Floats]) -> Fit:
            return self._minimised(
                self._c,
                starts,
                lambda at: _deviance(self._c.n, at, value),
                lambda at: at.grad_h + at.grad_r2 / value**2,
            )

        starts = (self._theta, self._apart())
        return self._end(fit, starts, estimate, -se, floor=0.0), self._end(fit, starts, estimate, se)

    def sd(self, k: int) -> tuple[float, float]:
        """Interval of the standard deviation of the random term of theta k; its low end may be zero."""
        estimate = self._best.sigma * float(self._theta[k])
        step = max(estimate / 4, self._best.sigma / 50)
        low, log_sigma = 0.0, np.log(self._best.sigma)
        starts = [np.r_[log_sigma, np.delete(one, k)] for one in (self._theta, self._apart())]

        def fit(value: float, starts: Sequence[Floats]) -> Fit:
            return self._held(k, value, starts)

        # Where the deviance has not risen enough at zero, zero lies within the interval.
        if estimate > 0 and fit(0.0, starts)[1] - self._least > self._rise:
            low = self._end(fit, starts, estimate, -min(step, estimate / 2), floor=0.0)
        return low, self._end(fit, starts, estimate, step)

    def _held(self, k: int, value: float, starts: Sequence[Floats]) -> Fit:
        """Least deviance with the standard deviation of theta k at `value`, over log sigma and all others."""
        others = np.delete(np.arange(len(self._theta)), k)
        n = self._c.n

        def objective(packed: Floats) -> tuple[float, Floats]:
            sigma, theta = float(np.exp(packed[0])), np.empty(len(self._theta))
            theta[others], theta[k] = packed[1:], value / sigma
            at = criterion(self._c, theta, reml=False)
            by_theta = at.grad_h + at.grad_r2 / sigma**2
            # By log sigma; the last part is theta_k = value / sigma, which falls as sigma rises.
            by_sigma = 2 * n - 2 * at.r2 / sigma**2 - theta[k] * by_theta[k]
            return _deviance(n, at, sigma), np.concatenate([[by_sigma], by_theta[others]])

        bounds: list[Bound] = [(None, None), *(self._bounds[other] for other in others)]
        return _least_of(_minimum(objective, start, bounds) for start in starts)

    def _fitted(self, c: CrossProducts, starts: Sequence[Floats]) -> Fit:
        return self._minimised(c, starts, lambda at: at.value, lambda at: at.gradient)

    def _minimised(
        self,
        c: CrossProducts,
        starts: Sequence[Floats],
        value: Callable[[Criterion], float],
        gradient: Callable[[Criterion], Floats],
    ) -> Fit:
        def objective(theta: Floats) -> tuple[float, Floats]:
            at = criterion(c, theta, reml=False)
            return value(at), gradient(at)

        return _least_of(_minimum(objective, start, self._bounds) for start in starts)

    def _apart(self) -> Floats:
        """A start whose random terms all have a variance."""
        return np.array([START_APART * (bound[0] == 0.0) for bound in self._bounds])

    def _end(
        self,
        fit: FitAt,
        starts: Sequence[Floats],
        estimate: float,
        step: float,
        floor: float = -np.inf,
    ) -> float:
        """Where the deviance has risen by chi-squared, on the side of `step`; NaN where it never does.

        Every fit goes on from those before it, which may lead into a minimum that is not the least: the end
        is fitted once more from `starts`, and where that is lower everything is. Without an end there, there
        is none.
        """
        path = _Path(fit, estimate, starts[0])
        end = self._solved(path.least, estimate, step, floor)
        if np.isnan(end) or fit(end, starts)[1] - self._least > self._rise - SLACK:
            return end
        return self._solved(lambda value: fit(value, starts)[1], estimate, step, floor)

    def _solved(
        self, deviance: Callable[[float], float], estimate: float, step: float, floor: float
    ) -> float:
        @cache
        def lacking(distance: float) -> float:
            # At the estimate the rise is zero by definition; a fit there would add its tolerance.
            if not distance:
                return -self._reach
            rise = deviance(estimate + distance) - self._least
            # The root of the rise is nearly linear in the distance, so that few fits find its zero.
            return float(np.sqrt(max(rise, 0.0))) - self._reach

        near, far = 0.0, self._reach * step
        for _ in range(MAX_DOUBLINGS):
            # Just above the floor: a residual SD of zero has no logarithm.
            far = max(far, (floor - estimate) * (1 - 1e-6)) if step < 0 else far
            if lacking(far) > 0:
                root = optimize.brentq(lacking, near, far, xtol=TOLERANCE * abs(far), rtol=1e-12)
                return estimate + float(root)
            near, far = far, 2 * far
        return float("nan")


class _Path:
    """Fits along one parameter, each begun where those before it point to."""

    def __init__(self, fit: FitAt, estimate: float, optimum: Floats) -> None:
        self._fit = fit
        self._known = [(estimate, optimum)]

    def least(self, value: float) -> float:
        """The deviance at `value`."""
        self._known.sort(key=lambda one: abs(one[0] - value))
        (at, start), *further = self._known
        if further and further[0][0] != at:
            behind, other = further[0]
            start = start + (start - other) * (value - at) / (at - behind)
        optimum, least = self._fit(value, [start])
        self._known.append((value, optimum))
        return least


def _least_of(fits: Iterable[Fit]) -> Fit:
    return min(fits, key=lambda fit: fit[1])


def _deviance(n: int, at: Criterion, sigma: float) -> float:
    return float(at.h + n * np.log(2 * np.pi * sigma**2) + at.r2 / sigma**2)


def _minimum(
    objective: Callable[[Floats], tuple[float, Floats]],
    start: Floats,
    bounds: list[Bound],
) -> tuple[Floats, float]:
    floors = np.array([low == 0.0 for low, _ in bounds])
    best, least = start, np.inf
    for _ in range(MAX_RESTARTS):
        # a theta at zero is stationary whatever the data say: it starts above, and may fall back
        point = np.where(floors & (best < LIFT), LIFT, best)
        optimum = optimize.minimize(
            objective,
            point,
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": 500, "maxfun": 1000, "ftol": 1e-12, "gtol": 1e-6, "maxcor": 30},
        )
        fallen = least - float(optimum.fun)
        if fallen > 0:
            best, least = np.asarray(optimum.x, dtype=np.float64), float(optimum.fun)
        if fallen < SETTLED:
            break
    return best, least


def _without(c: CrossProducts, column: int | NDArray[np.int64], value: float) -> CrossProducts:
    """The cross-products of the model in which a coefficient, or each of several, has this value."""
    # A linear change of the columns: the cross-products need no second pass over the trials.
    turn = np.delete(np.eye(c.f + 1), column, axis=1)
    turn[column, -1] = -value
    return replace(c, pb=c.pb @ turn, cb=c.cb @ turn, bb=turn.T @ c.bb @ turn)


# Profile likelihood intervals in addition to the estimates of a linear mixed model.


def with_intervals(
    result: MixedResult,
    c: CrossProducts,
    theta: Floats,
    units: Units,
    progress: Callable[[str], None] | None = None,
    scales: Sequence[float] = (),
) -> MixedResult:
    """Add profile intervals; standard deviations of correlated slopes are not parameters and have none.

    Parameters
    ----------
    result : MixedResult
        Without intervals.
    c : CrossProducts
        What it was fitted to.
    theta : (m,) array
        The REML estimate.
    units : Units
        The scale of `c`.
    progress : callable, optional
        Takes a word on every interval before it is computed.
    scales : sequence of float
        Standard deviations of the covariates whose slopes the components are; 1 of others. Empty for all 1.
    """
    profile = Profile(c, theta)
    own = [row for row in result.components if row.group == result.components[0].group]
    positions: list[int | None] = list(range(len(own)))
    if result.slopes == "correlated":
        positions = [None] * len(own)
    positions = [None if row.correlations else k for row, k in zip(own, positions, strict=True)]
    further = len(result.components) - 1 - len(own)
    positions += [c.blocks[0].theta.stop + k for k in range(further)]
    known_sds = sum(k is not None for k in positions) + 1
    count = known_sds + len(result.coefficients)

    def say(number: int, name: str) -> None:
        if progress:
            progress(f"interval {number} of {count}, {name}")

    ends: list[tuple[float, float] | None] = []
    number = 0
    for row, k, scale in zip(result.components, positions, scales or [1.0] * len(positions), strict=False):
        if k is None:
            ends.append(None)
            continue
        number += 1
        say(number, f"SD of {row.group} {row.term}".strip())
        low, high = profile.sd(k)
        ends.append((low / scale, high / scale))
    ends.append(profile.sigma())
    coefficients = []
    for column, known in enumerate(result.coefficients):
        say(count - len(result.coefficients) + column + 1, known.name)
        ci = units.interval(profile.coefficient(column), intercept=column == 0)
        coefficients.append(replace(known, ci=ci))
    components = tuple(
        replace(row, ci=ci and units.interval(ci)) for row, ci in zip(result.components, ends, strict=True)
    )
    return _said(replace(result, coefficients=tuple(coefficients), components=components))


def _said(result: MixedResult) -> MixedResult:
    """With a note on every interval that has no end."""
    named = [(row.name, row.ci) for row in result.coefficients]
    named += [(f"{row.group} {row.term}".strip(), row.ci) for row in result.components]
    open_ended = [name for name, ci in named if ci and not np.isfinite(ci).all()]
    if not open_ended:
        return result
    note = f"the profile interval of {', '.join(open_ended)} is open on at least one side"
    return replace(result, notes=(*result.notes, note))
