"""Thresholds of every person and condition, and their mean over people."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from analysis.thresholds.answers import Answers, count_trials
from analysis.thresholds.likelihood import CHI2_95, Array, Interval, Shape, Trials
from analysis.thresholds.psychometric import FALLS, Threshold, fit_threshold
from experiments.errors import InputError

# Mean over people of estimates with known errors.


@dataclass(frozen=True)
class Average:
    """Mean of estimates with known errors over people; see `average`.

    `se` and its interval are NaN where all people have the same estimate.
    """

    people: int
    mean: float
    se: float
    ci_low: float
    ci_high: float
    tau: float


EQUAL = 1e-6
"""Estimates that vary this little, in squares of their errors, are equal: fits end at about 1e-8."""


def average(y: Array, errors: Array) -> Average | None:
    r"""Average estimates y (n,) over people, each weighted by 1 / (se^2 + tau^2); None below two people.

    tau^2 maximizes the restricted likelihood of

    .. math::

        y_i &\sim N(\mu, s_i^2 + \tau^2), \quad w_i = 1 / (s_i^2 + \tau^2) \tag{1} \\
        -\log L_R &= \tfrac{1}{2} \{\log \textstyle\sum_i w_i - \sum_i \log w_i
            + \sum_i w_i (y_i - \hat\mu)^2\} \tag{2} \\
        \mathrm{se}^2 &= \textstyle\sum_i w_i (y_i - \hat\mu)^2 / \{(k - 1) \sum_i w_i\} \tag{3}

    with y_i a person's estimate, s_i its standard error, mu the weighted mean and k the people; (3), with
    t on k - 1 df, is Hartung and Knapp's (2001). If all y_i are equal it would be 0, a certainty that people
    who switch between the same two levels do not give: then it and the interval are NaN.
    """
    if len(y) < 2:
        return None
    s2 = errors**2

    def restricted(log_tau2: float) -> float:
        weights = 1 / (s2 + np.exp(log_tau2))
        mu = np.sum(weights * y) / weights.sum()
        return float(
            0.5 * (np.log(weights.sum()) - np.sum(np.log(weights)) + np.sum(weights * (y - mu) ** 2))
        )

    span = float(np.var(y)) + float(s2.mean())
    optimum = optimize.minimize_scalar(
        # Below, tau vanishes next to any error; above, it would exceed the spread of the thresholds
        # themselves.
        restricted,
        bounds=(np.log(span) - 25, np.log(span) + 3),
        method="bounded",
    )
    # The likelihood may rise all the way to tau = 0, which no finite logarithm reaches.
    tau2 = float(np.exp(optimum.x)) if optimum.fun < restricted(-np.inf) else 0.0
    weights = 1 / (s2 + tau2)
    mean = float(np.sum(weights * y) / weights.sum())
    count = len(y)
    variation = float(np.sum(weights * (y - mean) ** 2)) / (count - 1)
    se = float(np.sqrt(variation / weights.sum())) if variation > EQUAL else float("nan")
    half = float(stats.t.ppf(0.975, count - 1)) * se
    return Average(count, mean, se, mean - half, mean + half, float(np.sqrt(tau2)))


# Thresholds of a population: every person has a threshold and a spread, drawn from one distribution.

NODES = 15
"""Gauss-Hermite nodes for a person's threshold, and for the spread."""

NEWTON_STEPS = 25
# About the fourth root of the machine's precision, where rounding and truncation of second differences are
# equal.
STEP = 1e-4
# exp(-12) = 6e-6 of the width: zero in every printed digit, while the logarithm stays finite.
LOG_SD_MIN = -12.0
SHAPES_WITH_POPULATION = ("normal", "logistic")


@dataclass(frozen=True)
class Population:
    """What the thresholds a_i and log spreads of people are drawn from.

    Attributes
    ----------
    threshold, threshold_se : float
        Mean over people of a_i, in the unit of x.
    threshold_ci : Interval
        Profile likelihood interval (95%): everything else is fitted again.
    threshold_sd : float
        SD of a_i between people.
    spread : float
        exp of the mean log spread, in the unit of x.
    log_spread_sd : float
        SD of the log spread between people.
    lapse : float
        As it was held.
    """

    people: int
    threshold: float
    threshold_se: float
    threshold_ci: Interval
    threshold_sd: float
    spread: float
    log_spread_sd: float
    lapse: float
    log_likelihood: float


class PopulationLikelihood:
    r"""Marginal likelihood of people's trials.

    .. math::

        L = \prod_i \int \prod_j P(x_{ij})^{k_{ij}} (1 - P(x_{ij}))^{n_{ij} - k_{ij}}
            \phi(u_1) \phi(u_2) \, du, \quad a_i = \mu + \tau u_1, \ \log b_i = \nu + \omega u_2 \tag{1}

    by adaptive Gauss-Hermite quadrature around each person's mode. Trials are padded to (people, levels).
    """

    def __init__(
        self, trials: Sequence[Trials], shape: Shape, guess: float, lapse: float, falling: bool
    ) -> None:
        size = max(len(one.x) for one in trials)
        # The padding has n = 0 and says nothing, whatever its x.
        self.x, self.n, self.k = (
            np.array([np.pad(getattr(one, name), (0, size - len(one.x))) for one in trials])[:, None, :]
            for name in ("x", "n", "k")
        )
        self.shape, self.guess, self.lapse, self.falling = shape, guess, lapse, falling
        nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
        self.nodes = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
        # the weights' own normal density is divided out: the integrand is evaluated whole
        self.log_weights = np.log(np.outer(weights, weights)).ravel() + (self.nodes**2).sum(axis=1) / 2
        self.modes = np.zeros((len(trials), 2))

    def joint(self, values: Array, u: Array) -> Array:
        r"""Log of trials' likelihood times both normal densities, at u (people, m, 2): (people, m).

        .. math::

            p &= \gamma + (1 - \gamma - \lambda) F\{(x - \mu - \tau u_1) / e^{\nu + \omega u_2}\} \tag{1} \\
            \log g &= \textstyle\sum_m k_m \log p_m + (n_m - k_m) \log(1 - p_m) - u'u / 2 - \log 2 \pi \tag{2}

        gamma and lambda are guesses and lapses; mu and tau mean and SD of people's thresholds, nu and omega
        those of the logs of their spreads; k of n answers at stimulus x were yes.
        """
        mu, log_tau, nu, log_omega = values
        location = mu + np.exp(log_tau) * u[..., :1]
        # During the search a log spread may have any size: exp must not overflow.
        log_spread = np.clip(nu + np.exp(log_omega) * u[..., 1:], -30.0, 30.0)
        z = (self.x - location) * np.exp(-log_spread)
        rising = special.ndtr(z) if self.shape == "normal" else special.expit(z)
        f = 1 - rising if self.falling else rising
        p = np.clip(self.guess + (1 - self.guess - self.lapse) * f, 1e-12, 1 - 1e-12)
        trials = (self.k * np.log(p) + (self.n - self.k) * np.log1p(-p)).sum(axis=-1)
        return np.asarray(trials - (u**2).sum(axis=-1) / 2 - np.log(2 * np.pi))

    def _differences(self, values: Array, u: Array) -> tuple[Array, Array]:
        r"""Gradient (people, 2) and Hessian (people, 2, 2) of `joint` at u (people, 2), by differences.

        .. math::

            g_1 &= (j_{+0} - j_{-0}) / 2h, \quad h_{11} = (j_{+0} + j_{-0} - 2 j_{00}) / h^2 \tag{3} \\
            h_{12} &= \{(j_{++} + j_{--} - 2 j_{00}) / h^2 - h_{11} - h_{22}\} / 2 \tag{4}

        j is `joint`, its indices the steps of h along the two coefficients.
        """
        moves = STEP * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1]], dtype=float)
        at = self.joint(values, u[:, None, :] + moves)
        gradient = np.stack([at[:, 1] - at[:, 2], at[:, 3] - at[:, 4]], axis=1) / (2 * STEP)
        first = (at[:, 1] + at[:, 2] - 2 * at[:, 0]) / STEP**2
        second = (at[:, 3] + at[:, 4] - 2 * at[:, 0]) / STEP**2
        mixed = (at[:, 5] + at[:, 6] - 2 * at[:, 0]) / STEP**2
        mixed = (mixed - first - second) / 2
        return gradient, np.stack([first, mixed, mixed, second], axis=1).reshape(-1, 2, 2)

    def value(self, values: Array) -> float:
        """Log-likelihood at (mu, log tau, nu, log omega)."""
        # The parameters have moved little since the last call, and so have the modes: two or three steps
        # are enough.
        u = self.modes
        for _ in range(NEWTON_STEPS):
            gradient, hessian = self._differences(values, u)
            curvature = _positive(-hessian)
            step = np.linalg.solve(curvature, gradient[:, :, None])[:, :, 0]
            # At most 1.5 prior SDs at once: far from its mode a posterior is not a parabola.
            step *= np.minimum(1.0, 1.5 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
            better = self.joint(values, (u + step)[:, None])[:, 0] >= self.joint(values, u[:, None])[:, 0]
            # All people move together in one array, so a step that would lose is cut, not searched along.
            u = u + np.where(better[:, None], step, step / 8)
            if np.abs(step).max() < 1e-5:
                break
        self.modes = u
        _, hessian = self._differences(values, u)
        root = np.linalg.cholesky(np.linalg.inv(_positive(-hessian)))
        points = u[:, None, :] + self.nodes @ root.transpose(0, 2, 1)
        total = special.logsumexp(self.joint(values, points) + self.log_weights, axis=1)
        return float((total + np.log(root[:, 0, 0]) + np.log(root[:, 1, 1])).sum())


def _positive(matrices: Array) -> Array:
    """Symmetric matrices (people, 2, 2) with eigenvalues of at least one half: the prior's are one."""
    values, vectors = np.linalg.eigh(matrices)
    return np.asarray((vectors * np.maximum(values, 0.5)[:, None, :]) @ vectors.transpose(0, 2, 1))


def fit_population(
    trials: Sequence[Trials], shape: Shape, guess: float, lapse: float, falling: bool
) -> Population:
    """Maximize the marginal likelihood of people's trials over means and SDs of threshold and log spread.

    Raises
    ------
    InputError
        Fewer than three people, or a Weibull function, whose threshold is not a normal variable.
    """
    if shape not in SHAPES_WITH_POPULATION:
        raise InputError("--hierarchical needs --function normal or logistic")
    if len(trials) < 3:
        raise InputError(f"--hierarchical needs at least three people, got {len(trials)}")
    model = PopulationLikelihood(trials, shape, guess, lapse, falling)
    x = np.concatenate([one.x for one in trials])
    width = float(np.ptp(x)) or 1.0
    start = np.array([x.mean(), np.log(width / 8), np.log(width / 6), np.log(0.3)])
    best = _maximum(model, start, width, None)
    value, mu = model.value(best), float(best[0])
    # A difference of the profile, not of the likelihood: the error then holds that of every other
    # parameter.
    h = 1e-3 * width
    sides = [_profiled(model, best, width, mu + sign * h) for sign in (1, -1)]
    curvature = (2 * value - sum(sides)) / h**2
    se = float(1 / np.sqrt(curvature)) if curvature > 0 else float("nan")
    ends = [
        _end(model, best, value, width, sign * (se if np.isfinite(se) else width / 8)) for sign in (-1, 1)
    ]
    return Population(
        len(trials),
        mu,
        se,
        Interval(ends[0], ends[1]),
        float(np.exp(best[1])),
        float(np.exp(best[2])),
        float(np.exp(best[3])),
        lapse,
        value,
    )


def _maximum(model: PopulationLikelihood, start: Array, width: float, mu: float | None) -> Array:
    # The search's tolerances are absolute: mu is brought to the size of the logarithms next to it.
    scale = np.array([width, 1.0, 1.0, 1.0])

    def negative(scaled: NDArray[np.float64]) -> float:
        full = scaled if mu is None else np.concatenate([[mu / width], scaled])
        return -model.value(full * scale)

    first = start / scale
    free = first if mu is None else first[1:]
    bounds = [(None, None), (LOG_SD_MIN + np.log(width), None), (None, None), (LOG_SD_MIN, 2.0)]
    optimum = optimize.minimize(
        negative,
        free,
        method="L-BFGS-B",
        bounds=bounds[4 - len(free) :],
        options={"ftol": 1e-12, "gtol": 1e-6},
    )
    whole = optimum.x if mu is None else np.concatenate([[mu / width], optimum.x])
    return np.asarray(whole * scale)


def _profiled(model: PopulationLikelihood, best: Array, width: float, mu: float) -> float:
    return model.value(_maximum(model, np.concatenate([[mu], best[1:]]), width, mu))


def _end(model: PopulationLikelihood, best: Array, value: float, width: float, step: float) -> float | None:
    """Where the profile has fallen by half the chi-squared quantile, in the direction of `step`."""

    def fall(mu: float) -> float:
        return 2 * (value - _profiled(model, best, width, mu)) - CHI2_95

    inside, outside = float(best[0]), float(best[0]) + 2 * step
    # Sixteen standard errors out: a profile that has not fallen there has no end.
    for _ in range(8):
        if fall(outside) > 0:
            return float(optimize.brentq(fall, inside, outside, xtol=1e-6 * width))
        inside, outside = outside, outside + 2 * step
    return None


@dataclass(frozen=True)
class PersonThreshold:
    """One person's fit in one condition; `fit` is None where `reason` says why not."""

    participant: str
    condition: str
    fit: Threshold | None
    reason: str


@dataclass(frozen=True)
class MeanThreshold(Average):
    """Mean over people of their thresholds: a random-effects model of estimates with known errors.

    tau is the SD between people (REML); the interval uses t with people - 1 degrees of freedom (Hartung &
    Knapp 2001, Statistics in Medicine 20, 3875).
    """

    condition: str


@dataclass(frozen=True)
class ThresholdsResult:
    """Everything `analysis thresholds` knows of a table."""

    pooled: dict[str, Threshold]
    people: tuple[PersonThreshold, ...]
    means: tuple[MeanThreshold, ...]
    n_trials: int
    decisions: tuple[str, ...]
    population: dict[str, Population] = field(default_factory=dict)


def fit_thresholds(
    answers: Answers, shape: Shape, guess: float, lapse: float | None, falling: bool | None = None
) -> ThresholdsResult:
    """Fit every condition over all trials and, where people are named, every person in it.

    If `falling` is not given, the answers decide it: with a guess rate those of all conditions together.

    Raises
    ------
    InputError
        Where a condition cannot be fitted at all.
    """
    # sums this short only wait for a second thread
    with threadpool_limits(1, "blas"):
        return _fitted(answers, shape, guess, lapse, falling)


def _fitted(
    answers: Answers, shape: Shape, guess: float, lapse: float | None, falling: bool | None
) -> ThresholdsResult:
    labels = np.full(answers.x.size, "all", dtype=object) if answers.condition is None else answers.condition
    pooled: dict[str, Threshold] = {}
    people: list[PersonThreshold] = []
    is_declared = falling is not None
    if guess and not is_declared:
        falling = falls_together(answers.x, answers.response, labels)
    for condition in answers.conditions():
        rows = labels == condition
        try:
            fit = fit_threshold(
                count_trials(answers.x[rows], answers.response[rows]), shape, guess, lapse, falling=falling
            )
            noted = guess and fit.falling and not is_declared
            pooled[condition] = replace(fit, notes=(*fit.notes, FALLS)) if noted else fit
        except InputError as error:
            where = "" if condition == "all" else f" ({condition})"
            raise InputError(f"{answers.source}{where}: {error}") from error
        if answers.participant is not None:
            # From everybody's answers: one person's few answers, or exchanged keys, must not reverse it.
            down = pooled[condition].falling
            people += _people(answers, rows, condition, shape, guess, lapse, down)
    means = [mean for condition in pooled if (mean := mean_threshold(people, condition)) is not None]
    return ThresholdsResult(pooled, tuple(people), tuple(means), answers.x.size, answers.decisions)


def falls_together(x: Array, response: Array, labels: NDArray[np.object_]) -> bool:
    """Whether positive answers become rarer with x within the conditions that `labels` (n,) name.

    In a condition at chance correct answers fall as often as they rise; the other conditions decide for it.
    """
    covariances = [
        np.sum((x[labels == one] - x[labels == one].mean()) * response[labels == one])
        for one in sorted(set(labels))
    ]
    return float(np.sum(covariances)) < 0


def with_population(
    result: ThresholdsResult, answers: Answers, shape: Shape, guess: float, lapse: float | None
) -> ThresholdsResult:
    """The result with, for each condition, one model over all people: `fit_population`.

    Raises
    ------
    InputError
        No column names the person, a lapse rate to be fitted, or as `fit_population`.
    """
    if answers.participant is None:
        raise InputError("--hierarchical needs --participant with the column of the person")
    if lapse is None:
        raise InputError("--hierarchical holds the lapse rate; give it as a number, --lapse 0.02")
    populations, names = {}, answers.participant.astype(str)
    for condition, pooled in result.pooled.items():
        own = np.ones(answers.x.size, bool) if answers.condition is None else answers.condition == condition
        rows = [own & (names == name) for name in sorted(set(names[own]))]
        trials = [count_trials(answers.x[one], answers.response[one]) for one in rows]
        populations[condition] = fit_population(trials, shape, guess, lapse, pooled.falling)
    return replace(result, population=populations)


def _people(
    answers: Answers,
    rows: NDArray[np.bool_],
    condition: str,
    shape: Shape,
    guess: float,
    lapse: float | None,
    falling: bool,
) -> list[PersonThreshold]:
    fits = []
    names = answers.participant
    for name in sorted({str(one) for one in names[rows]}) if names is not None else []:
        own = rows & (names == name)
        try:
            trials = count_trials(answers.x[own], answers.response[own])
            fit = fit_threshold(trials, shape, guess, lapse, falling=falling)
            fits.append(PersonThreshold(name, condition, fit, ""))
        except InputError as error:
            fits.append(PersonThreshold(name, condition, None, str(error)))
    return fits


def mean_threshold(people: list[PersonThreshold], condition: str) -> MeanThreshold | None:
    """Average thresholds over people; None below two people."""
    own = [one.fit for one in people if one.condition == condition and one.fit is not None]
    # A threshold without an error has no weight in the mean.
    known = [(fit.threshold, fit.threshold_se) for fit in own if fit.threshold_se]
    made = average(np.array([a for a, _ in known]), np.array([float(b or 0) for _, b in known]))
    return None if made is None else MeanThreshold(**vars(made), condition=condition)
