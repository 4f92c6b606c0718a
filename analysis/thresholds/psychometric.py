"""The psychometric function: fitted by maximum likelihood, with profile likelihood intervals."""

from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from analysis.thresholds.likelihood import (
    BOUND,
    LAPSE_MAX,
    Array,
    Interval,
    Likelihood,
    Shape,
    Trials,
    fit_p,
    function,
    too_few_repeats,
)
from experiments.errors import InputError

NORMAL_95 = float(special.ndtri(0.975))

# Far below what any number of answers can distinguish from 0 or 1, far above the rounding of F.
STEP = 1e-6
"""How near its ends a function is that has reached them."""
FALLS = "correct answers become rarer as x increases: the function falls"


@dataclass(frozen=True)
class Threshold:
    """A fitted psychometric function.

    Attributes
    ----------
    threshold : float
        Where F is one half: the underlying F50, in the unit of x.
    threshold_se : float or None
        See `error_of`.
    x75 : float or None
        Where the whole function is .75; None where it never is. With a guess rate of 0.5 and no lapses it is
        the threshold, with 0 it is not.
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


def fit_threshold(
    trials: Trials,
    shape: Shape = "normal",
    guess: float = 0.0,
    lapse: float | None = 0.0,
    *,
    intervals: bool = True,
    falling: bool | None = None,
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
        Whether to profile the likelihood for intervals: every other parameter is fitted again at each value.

    falling : bool, optional
        Whether positive answers become rarer with x; if not given, the answers decide it.

    Raises
    ------
    InputError
        Too few levels, answers all alike, an answer that does not change with x, a threshold far outside.
    """
    refuse_unfit(trials, shape)
    centre, unit = _scale(trials, shape)
    model = Likelihood(Trials((trials.x - centre) / unit, trials.n, trials.k), shape, guess, lapse, falling)
    best, value = model.maximum({})
    location = centre + unit * best[0]
    # The Weibull's spread is an exponent and has no unit.
    log_spread = best[1] + (0.0 if shape == "weibull" else float(np.log(unit)))
    lapsed = best[2] if lapse is None else lapse
    step = _is_step(model, trials, best)
    notes = _doubts(trials, location, log_spread, shape, lapsed, lapse is None, step) + _below(trials, guess)
    notes += _untested(trials, len(best))
    if guess and model.falling and falling is None:
        notes.append(FALLS)
    low, high = float(trials.x.min()), float(trials.x.max())
    # Three ranges away F is as good as straight over the levels: its place would follow from its assumed
    # shape alone.
    if not low - 3 * (high - low) <= location <= high + 3 * (high - low):
        raise InputError(
            f"the threshold is far outside the levels shown ({low:g} to {high:g}); the answers hardly change "
            "with x"
        )
    expected = model.probabilities(best)
    deviance, df = _deviance(trials, expected), trials.x.size - len(best)
    empty = Interval(None, None)
    location_ci = model.profile(0, best, value) if intervals else empty
    spread_ci = model.profile(1, best, value) if intervals else empty
    # At the edge of its range the score of the lapse rate is not zero, and the curvature there is no
    # information.
    curvature = model.standard_error(best) if lapsed > BOUND or lapse is not None else None
    error = error_of(curvature, location_ci)
    level = _level(model, best, 0.75)
    grown = 1.0 if shape == "weibull" else unit
    return Threshold(
        shape,
        guess,
        float(lapsed),
        lapse is None,
        float(location),
        None if error is None else unit * error,
        location_ci.changed(lambda end: centre + unit * end),
        float(np.exp(log_spread)),
        spread_ci.changed(lambda end: grown * float(np.exp(end))),
        _slope(shape, location, log_spread) * (-1.0 if model.falling else 1.0),
        None if level is None else centre + unit * level,
        float(value),
        deviance,
        df,
        fit_p(deviance, df, trials.n),
        int(trials.n.sum()),
        trials.x.size,
        model.falling,
        tuple(notes),
    )


def _scale(trials: Trials, shape: Shape) -> tuple[float, float]:
    """Center and unit in which x is fitted: steps and tolerances are absolute, units of x are anyone's."""
    unit = float(trials.x.max() - trials.x.min())
    # The Weibull begins at x = 0: it may be scaled, but not moved.
    return (0.0 if shape == "weibull" else float(np.average(trials.x, weights=trials.n))), unit


def error_of(curvature: float | None, interval: Interval) -> float | None:
    """Standard error of a threshold: of the curvature, or of the profile where that says nothing.

    Where answers switch at one level the likelihood's maximum is a ridge of ever steeper slopes: the
    curvature there gives no error, or one beyond the whole interval, though the profile of the threshold is
    closed. It gives none either where the fitted lapse rate is 0 or 0.1, an end of its range. Then half of
    the 95% interval counts as 1.96 errors. None where the interval is open too.
    """
    if interval.low is None or interval.high is None:
        return curvature
    width = interval.high - interval.low
    return curvature if curvature and curvature < width else width / (2 * NORMAL_95)


def refuse_unfit(trials: Trials, shape: Shape) -> None:
    """Refuse data on which no function can be placed."""
    if trials.x.size < 2:
        raise InputError(f"expected answers at two levels of x or more, got {trials.x.size}")
    share = trials.k.sum() / trials.n.sum()
    if share in (0.0, 1.0):
        raise InputError(
            f"all {int(trials.n.sum())} answers are the same; there is no threshold among these levels"
        )
    if shape == "weibull" and trials.x.min() <= 0:
        raise InputError(
            f"the Weibull function needs x above 0, got {trials.x.min():g}; use --function normal"
        )


def _slope(shape: Shape, location: float, log_spread: float) -> float:
    b = float(np.exp(log_spread))
    if shape == "normal":
        return 1.0 / (b * float(np.sqrt(2 * np.pi)))
    return 1.0 / (4 * b) if shape == "logistic" else float(np.log(2) / 2) * b / location


def _level(model: Likelihood, best: Array, level: float) -> float | None:
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
    # A level with answers of one kind adds 0 log 0, which is 0 here and NaN with `log`.
    terms = special.xlogy(yes, yes / (trials.n * p)) + special.xlogy(no, no / (trials.n * (1 - p)))
    return float(2 * terms.sum())


def _is_step(model: Likelihood, trials: Trials, best: Array) -> bool:
    """Whether the function is a step: the likelihood never falls as the slope grows.

    Without guesses and lapses that is so where every level but one has answers of one kind alone, the other
    kind on the other side; else where the fitted function passes between its ends at one level at most.
    """
    shares = trials.k / trials.n
    rising = 1 - shares if model.falling else shares
    if model.guess == 0 and not model.lapse and best.size == 2:
        return bool((np.diff(rising) >= 0).all() and ((rising > 0) & (rising < 1)).sum() <= 1)
    f = function(model.shape, model.trials.x, float(best[0]), float(best[1]))
    return int(((f > STEP) & (f < 1 - STEP)).sum()) <= 1


def _doubts(
    trials: Trials,
    location: float,
    log_spread: float,
    shape: Shape,
    lapse: float,
    fitted: bool,
    step: bool,
) -> list[str]:
    notes = []
    if not trials.x.min() <= location <= trials.x.max():
        notes.append(f"the threshold {location:.4g} is outside the levels shown (extrapolated)")
    if step:
        notes.append("the answers switch between two levels: the slope has no upper limit")
    if fitted and lapse <= BOUND:
        notes.append("the lapse rate is estimated at its bound 0")
    if fitted and lapse >= LAPSE_MAX - BOUND:
        notes.append(f"the lapse rate is estimated at its bound {LAPSE_MAX:g}")
    if shape != "weibull" and np.exp(log_spread) > 10 * (trials.x.max() - trials.x.min()):
        notes.append("the answers hardly change over the levels shown")
    return notes


def _untested(trials: Trials, parameters: int) -> list[str]:
    """Say that the fit is not tested where stimuli were repeated too rarely."""
    if trials.x.size <= parameters or not too_few_repeats(trials.n):
        return []
    return [
        f"no fit p: {int(trials.n.sum())} answers at {trials.x.size} levels are too few per stimulus for "
        "a test of fit"
    ]


def _below(trials: Trials, guess: float) -> list[str]:
    """Say at which level fewer answers are yes than guessing alone gives, with p below .001 over levels."""
    chance = np.asarray(stats.binom.cdf(trials.k, trials.n, guess))
    # Times the number of levels: Bonferroni's bound for looking at the smallest p.
    if guess == 0 or chance.min() * trials.x.size > 0.001:
        return []
    at = int(chance.argmin())
    return [
        f"at {trials.x[at]:g} {trials.k[at]:g} of {trials.n[at]:g} answers are yes, fewer than expected from "
        f"a guess rate of {guess:g}: the threshold is valid only if this is the guess rate"
    ]
