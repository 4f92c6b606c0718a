"""Thresholds over two stimulus variables: of every condition and person, and their means over people."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from analysis.thresholds.answers import Answers
from analysis.thresholds.likelihood import Interval, normal_density
from analysis.thresholds.people import Average, average, falls_together
from analysis.thresholds.plane import Plane, PlaneShape, Points, counted_points, fit_plane
from experiments.errors import InputError

# Lines of thresholds of a population: people's thresholds and tilts are drawn from one distribution.

Array = NDArray[np.float64]
PEOPLE_MIN = 3
NODES, END = (41, 11), (5.0, 4.0)
"""Nodes from -END to END, in SDs, over people's thresholds and over their tilts."""

SECANTS, CLOSE, FARTHEST = 12, 4e-3, 4
"""Steps to an end of an interval, how near (in the root of the fall) is enough, and how far off it is sought,
in ranges of the stimuli."""

SMALLEST = 1e-3
"""Least SD of people's thresholds and tilts, in ranges of the stimuli: below it people are alike."""

MU, TILT, LOG_SPREAD, LOG_SD, LOG_TILT_SD = range(5)


@dataclass(frozen=True)
class PopulationPlane:
    """What the thresholds (at the middle) and tilts of people are drawn from; see `fit_plane_population`.

    Attributes
    ----------
    threshold, tilt : float
        Means over people; the tilt in units of x a unit of z.
    threshold_ci, tilt_ci : Interval
        95% profiles of the likelihood with the quantile of F(1, people - 1).
    threshold_sd, tilt_sd : float
        SDs between people.
    spread : float
        SD (normal) or scale (logistic) of the function along x, one for all people.
    """

    people: int
    threshold: float
    threshold_ci: Interval
    threshold_sd: float
    tilt: float
    tilt_ci: Interval
    tilt_sd: float
    spread: float
    log_likelihood: float


def fit_plane_population(people: Sequence[Points], pooled: Plane) -> PopulationPlane:
    r"""Fit means and SDs of people's thresholds and tilts by maximum marginal likelihood.

    .. math::

        L = \prod_i \int \prod_j P_i(x_j, z_j)^{k_{ij}} (1 - P_i(x_j, z_j))^{n_{ij} - k_{ij}}
            \phi(u) \phi(v) \, du \, dv, \quad t_i = \mu + \tau u, \ b_i = \beta + \omega v \tag{1}

    with P_i of equation (1) in `analysis.thresholds.plane.fit_plane`, whose threshold t is t_i and whose tilt
    b is b_i, and one spread s for all. Nobody is excluded: answers without an individual threshold, such as
    those that switch without overlap, still inform the mean.

    Parameters
    ----------
    people : sequence of Points
        The answers of each person.
    pooled : Plane
        The fit over all trials, from which the search starts and which says shape, ends and middle.

    Raises
    ------
    InputError
        Fewer than three people.
    """
    if len(people) < PEOPLE_MIN:
        raise InputError(f"a population needs {PEOPLE_MIN} people or more, got {len(people)}")
    model = MarginalLikelihood(people, pooled)
    best, value = model.maximum(model.start)
    sign = model.sign
    ends = {part: model.ends(best, value, part) for part in (MU, TILT)}
    sds = np.exp(best[[LOG_SPREAD, LOG_SD, LOG_TILT_SD]])
    return PopulationPlane(
        len(people),
        float(sign * best[MU]),
        _turned(ends[MU], sign),
        float(sds[1]),
        float(sign * best[TILT]),
        _turned(ends[TILT], sign),
        float(sds[2]),
        float(sds[0]),
        value,
    )


def _turned(ends: tuple[float | None, float | None], sign: float) -> Interval:
    low, high = ends
    if sign > 0:
        return Interval(low, high)
    # A mirrored axis turns the ends around.
    return Interval(None if high is None else -high, None if low is None else -low)


class MarginalLikelihood:
    """Equation (1) and its gradient in (mu, beta, log s, log tau, log omega); x turns where it falls."""

    def __init__(self, people: Sequence[Points], pooled: Plane) -> None:
        self.pooled, self.sign = pooled, -1.0 if pooled.falling else 1.0
        # One grid of stimuli for all people: P is computed once per node, not once per person.
        stimuli = np.unique(np.concatenate([np.column_stack([one.x, one.z]) for one in people]), axis=0)
        rows = {(x, z): row for row, (x, z) in enumerate(stimuli.tolist())}
        self.n, self.k = np.zeros((2, len(people), len(stimuli)))
        for person, one in enumerate(people):
            at = [rows[x, z] for x, z in zip(one.x.tolist(), one.z.tolist(), strict=True)]
            # Stimuli that a person has not seen keep n = 0 and add nothing.
            self.n[person, at], self.k[person, at] = one.n, one.k
        self.x, self.away = self.sign * stimuli[:, :1], stimuli[:, 1:] - pooled.middle
        u, v = (np.linspace(-end, end, count) for end, count in zip(END, NODES, strict=True))
        self.u, self.v = (grid.ravel() for grid in np.meshgrid(u, v, indexing="ij"))
        weights = stats.norm.logpdf(self.u) + stats.norm.logpdf(self.v)
        # Normalized, so that even nodes, unlike Gauss and Hermite's, still give a mean: the ends of the
        # grid lose nothing that counts.
        self.log_weights = weights - special.logsumexp(weights)
        self.width = float(np.ptp(self.x))
        # A tilt changes x along z, so its unit is the ratio of both ranges.
        self.slope_unit = self.width / float(np.ptp(self.away))
        # F(1, n - 1), the square of t: with few people chi-squared would be too sure.
        self.limit = float(stats.f.ppf(0.95, 1, len(people) - 1))

    @property
    def start(self) -> Array:
        """The pooled fit, with people who differ by half its spread."""
        fit = self.pooled
        # A pooled spread near zero would start the search on a step, whose gradient says little.
        spread = max(fit.spread, 0.02 * self.width)
        # Logarithms keep spreads above 0 in the search.
        logs = np.log([spread, spread / 2, 0.1 * self.slope_unit])
        return np.array([self.sign * fit.threshold, self.sign * fit.tilt, *logs])

    def value(self, theta: Array) -> tuple[float, Array]:
        r"""The log-likelihood and its gradient (5,).

        Notes
        -----
        .. math::

            \eta &= \{x - \mu - \sigma u - (\theta + \omega v)(z - \bar z)\} / s \tag{1} \\
            \log L &= \sum_i \log \sum_{uv} w_{uv} \prod_m p_m^{k_{im}} (1 - p_m)^{n_{im} - k_{im}} \tag{2}

        u, v are the nodes and w their weights; mu and theta the threshold and tilt on average, sigma and
        omega their SDs over people, s the spread; k of n answers of person i at stimulus m were yes. The
        derivatives of (1) by mu, theta and the logs of s, sigma and omega are -1/s, -(z - zbar)/s, -eta,
        -sigma u/s and -omega v (z - zbar)/s; `score` is that of (2) by eta, the nodes weighted by what the
        answers say of them.
        """
        mu, tilt, (spread, sd, tilt_sd) = theta[MU], theta[TILT], np.exp(theta[LOG_SPREAD:])
        eta = (self.x - mu - sd * self.u - (tilt + tilt_sd * self.v) * self.away) / spread
        p, slope = self._share(eta)
        given = self.k @ np.log(p) + (self.n - self.k) @ np.log1p(-p) + self.log_weights
        each = special.logsumexp(given, axis=1)
        weights = np.exp(given - each[:, None])
        # Sums over people first: the matrix of stimuli by nodes is then multiplied once.
        score = (self.k.T @ weights / p - (self.n - self.k).T @ weights / (1 - p)) * slope
        by_node, by_tilt = score.sum(axis=0), (score * self.away).sum(axis=0)
        gradient = -np.array(
            [
                by_node.sum() / spread,
                by_tilt.sum() / spread,
                (score * eta).sum(),
                sd * (by_node @ self.u) / spread,
                tilt_sd * (by_tilt @ self.v) / spread,
            ]
        )
        return float(each.sum()), gradient

    def _share(self, eta: Array) -> tuple[Array, Array]:
        """P and dP/d eta."""
        fit = self.pooled
        if fit.shape == "normal":
            f, slope = special.ndtr(eta), normal_density(eta)
        else:
            f = special.expit(eta)
            slope = f * special.expit(-eta)
        scale = 1 - fit.guess - fit.lapse
        # Away from 0 and 1, whose logarithm has no limit.
        return np.clip(fit.guess + scale * f, 1e-12, 1 - 1e-12), scale * slope

    def maximum(self, start: Array, held: int | None = None) -> tuple[Array, float]:
        """The best parameters and their log-likelihood; the `held` one stays as it is at the start."""
        free = [part for part in range(5) if part != held]
        # The search's tolerances are absolute; thresholds are in anybody's unit.
        units = np.array([self.width, self.slope_unit, 1.0, 1.0, 1.0])

        def negative(scaled: Array) -> tuple[float, Array]:
            theta = start.copy()
            theta[free] = scaled * units[free]
            value, gradient = self.value(theta)
            return -value, -(gradient * units)[free]

        low_sd, low_tilt = np.log(SMALLEST * self.width), np.log(SMALLEST * self.slope_unit)
        # Means are free; spreads stay between a step and a flat line.
        far = [(None, None), (None, None), (np.log(self.width / 200), np.log(20 * self.width))]
        bounds = [*far, (low_sd, np.log(5 * self.width)), (low_tilt, np.log(20 * self.slope_unit))]
        optimum = optimize.minimize(
            negative,
            (start / units)[free],
            jac=True,
            method="L-BFGS-B",
            bounds=[bounds[part] for part in free],
            options={"ftol": 1e-9, "gtol": 1e-5},
        )
        theta = start.copy()
        theta[free] = optimum.x * units[free]
        return theta, -float(optimum.fun)

    def ends(self, best: Array, value: float, part: int) -> tuple[float | None, float | None]:
        """Where the profile of one parameter has fallen by the limit; None where it does not."""
        unit = self.width if part == MU else self.slope_unit
        return self._end(best, value, part, -unit), self._end(best, value, part, unit)

    def _end(self, best: Array, value: float, part: int, unit: float) -> float | None:
        """By secants on the root of twice the fall, which is nearly straight."""
        # At the estimate itself the fall is 0.
        root, below, above = np.sqrt(self.limit), (0.0, 0.0), None
        away = unit / 20
        for _ in range(SECANTS):
            held = best.copy()
            held[part] += away
            # The root of the fall is linear where the profile is a parabola, so that secants arrive in a
            # few steps.
            # Rounding may put the held maximum above the free one.
            height = float(np.sqrt(max(0.0, 2 * (value - self.maximum(held, part)[1]))))
            if abs(height - root) < CLOSE * root:
                return float(best[part] + away)
            if height < root:
                below = (away, height)
            else:
                above = (away, height)
            away = _next(below, above, float(root))
            # A profile so flat has no end: the interval is open on this side.
            if abs(away) > FARTHEST * abs(unit):
                return None
        return float(best[part] + away)


def _next(below: tuple[float, float], above: tuple[float, float] | None, root: float) -> float:
    """Where a straight line through two points reaches `root`; farther out where none lies above it."""
    if above is None:
        away, height = below
        return away * (min(4.0, max(1.5, 1.1 * root / height)) if height > 0 else 4.0)
    # Away from both ends: a secant that lands next to one hardly narrows the bracket.
    share = (root - below[1]) / (above[1] - below[1])
    return below[0] + min(max(share, 0.15), 0.85) * (above[0] - below[0])


@dataclass(frozen=True)
class PersonPlane:
    """One person's fit in one condition; `fit` is None where `reason` says why not."""

    participant: str
    condition: str
    fit: Plane | None
    reason: str


@dataclass(frozen=True)
class PlaneMeans:
    """Means over people of the threshold at the middle and of the tilt; None below two people."""

    threshold: Average | None
    tilt: Average | None


@dataclass(frozen=True)
class PlanesResult:
    """Everything that is known of answers over two variables, by condition.

    Attributes
    ----------
    pooled : dict of str to Plane
        Over all trials, as if one person had given them: too sure where people differ.
    reasons : dict of str to str
        Why a condition has no fit.
    people : tuple of PersonPlane
        Everybody's own fit.
    means : dict of str to PlaneMeans
        Over those who have an individual fit.
    population : dict of str to PopulationPlane
        Over everybody, where they are three or more.
    """

    pooled: dict[str, Plane]
    reasons: dict[str, str]
    people: tuple[PersonPlane, ...]
    means: dict[str, PlaneMeans]
    n_trials: int
    decisions: tuple[str, ...]
    population: dict[str, PopulationPlane] = field(default_factory=dict)


@dataclass(frozen=True)
class SeriesPlane:
    """One series: its trials by stimulus, and its fits; `result` is None where `reason` says why not."""

    name: str
    label: str
    points: Points
    result: PlanesResult | None
    reason: str | None


def fit_planes(
    answers: Answers,
    shape: PlaneShape,
    guess: float,
    lapse: float,
    *,
    falling: bool | None = None,
    middle: float | None = None,
) -> PlanesResult:
    """Fit every condition over all trials and, where people are named, every person in it and all together.

    If `falling` is not given, the answers decide it: with a guess rate those of all conditions together.

    Parameters
    ----------
    middle : float, optional
        The second variable's number at which thresholds are given. Fits that are compared must share it;
        halfway between the ends of these answers where it is not given.

    Raises
    ------
    InputError
        Where no condition can be fitted.
    """
    if answers.second is None:
        raise InputError(f"{answers.source}: expected a second stimulus variable, got none")
    size = answers.x.size
    labels = np.full(size, "all", dtype=object) if answers.condition is None else answers.condition
    names = np.full(size, "", dtype=object) if answers.participant is None else answers.participant
    if middle is None:
        # The middle of all answers, so that conditions are compared at the same place.
        middle = float(answers.second.min() + answers.second.max()) / 2
    pooled: dict[str, Plane] = {}
    reasons: dict[str, str] = {}
    people: list[PersonPlane] = []
    population: dict[str, PopulationPlane] = {}
    # With a guess rate, a condition at chance would fall as often as it rises.
    if falling is None and guess:
        falling = falls_together(answers.x, answers.response, labels)
    for condition in answers.conditions():
        rows = labels == condition
        down = falling
        if down is None:
            down = falls_together(answers.x[rows], answers.response[rows], labels[rows])
        fit, reason = fit_or_reason(points_of(answers, rows), shape, guess, lapse, down, middle)
        if fit is None:
            reasons[condition] = reason
        else:
            pooled[condition] = fit
        # Sorted, so that a report lists people in the same order each time.
        every = {name: points_of(answers, rows & (names == name)) for name in sorted({*names[rows]} - {""})}
        for name, mine in every.items():
            # One person: the interval along the whole line is needed for pooled fits only.
            fitted_own = fit_or_reason(mine, shape, guess, lapse, down, middle, along=False)
            people.append(PersonPlane(str(name), condition, *fitted_own))
        # The pooled fit is where the search for the population starts.
        if fit is not None and len(every) >= PEOPLE_MIN:
            population[condition] = fit_plane_population(list(every.values()), fit)
    if not pooled:
        # The first reason; others are mostly the same.
        raise InputError(f"{answers.source}: {next(iter(reasons.values()))}")
    means = {
        condition: means_of([one for one in people if one.condition == condition]) for condition in pooled
    }
    return PlanesResult(pooled, reasons, tuple(people), means, size, answers.decisions, population)


def points_of(answers: Answers, rows: NDArray[np.bool_] | slice = slice(None)) -> Points:
    """The answers of some rows counted by stimulus; of those over one variable the second is the first."""
    second = answers.x if answers.second is None else answers.second
    return counted_points(answers.x[rows], second[rows], answers.response[rows])


def fit_or_reason(
    points: Points,
    shape: PlaneShape,
    guess: float,
    lapse: float,
    falling: bool,
    middle: float,
    *,
    along: bool = True,
) -> tuple[Plane | None, str]:
    """The fit, or None and why there is none."""
    try:
        return fit_plane(points, shape, guess, lapse, falling=falling, middle=middle, along=along), ""
    except InputError as error:
        return None, str(error)


def means_of(people: Sequence[PersonPlane]) -> PlaneMeans:
    """Means over the people who have a fit."""
    fits = [one.fit for one in people if one.fit is not None]
    each: Mapping[str, Average | None] = {
        name: average(
            np.array([getattr(fit, name) for fit in fits]),
            np.array([getattr(fit, f"{name}_se") for fit in fits]),
        )
        for name in ("threshold", "tilt")
    }
    return PlaneMeans(each["threshold"], each["tilt"])
