"""A psychometric function of two stimulus variables: its threshold is a straight line over the second."""

from dataclasses import dataclass

import numpy as np

from analysis.thresholds.deviance import fit_p
from analysis.thresholds.likelihood import Interval
from analysis.thresholds.plane_likelihood import Array, PlaneLikelihood, PlaneShape, Points
from analysis.thresholds.plane_profiles import BROAD, PlaneProfiles
from experiments.errors import InputError

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
    parameter is fitted anew at each value.

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
    if not beta[1] > 1e-6 / width:
        raise InputError("the answers do not change with x as they should; there is no threshold to place")
    if link.steepest(beta, columns) < FLATTEST or np.linalg.cond(information) > MAX_CONDITION:
        raise InputError(
            "the answers switch between stimuli without overlap; tilt and spread have no estimate"
        )
    threshold, tilt, spread = -beta[0] / beta[1], -beta[2] / beta[1], 1 / beta[1]
    covariance = np.linalg.inv(information)
    gradients = np.array([[-spread, -threshold * spread, 0.0], [0.0, -tilt * spread, -spread]])
    errors = np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients))
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
            f"all {int(points.n.sum())} answers are alike; there is no threshold among these stimuli"
        )


def _broad(x: Array, width: float) -> list[Array]:
    """Functions of these spreads about the middle of x, without a tilt."""
    return [np.array([-x.mean(), 1.0, 0.0]) / (share * width) for share in BROAD]


def _turned(interval: Interval, sign: float) -> Interval:
    if sign > 0:
        return interval
    low, high = interval.high, interval.low
    return Interval(None if low is None else -low, None if high is None else -high)
