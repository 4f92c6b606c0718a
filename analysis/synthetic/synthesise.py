"""Make the ratings of synthetic participants that give published (or wished) figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.published import (
    DesignSpace,
    PublishedFigures,
    assumed,
    load_published,
    refuse_off_scale,
    wishes_for,
    with_wishes,
)
from analysis.synthetic.repair import RepairedSums, repair, value_of
from analysis.synthetic.targets import GivenWay, Steps, Targets, TestTarget, make_feasible, make_targets
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import RatedScale
from experiments.errors import InputError
from experiments.kinds import scale_called, scales_of
from experiments.load import SHIPPED, load_experiment

# Means and covariance of the cells that give the wanted figures, and participants drawn from them.

Floats = NDArray[np.float64]

NEVER_ABOVE = 0.5
"""Share of the F bound at which an effect of unknown size that must not be significant starts."""


@dataclass(frozen=True)
class Population:
    """Cell means (cells,) and covariance (cells, cells) of participants' cell means."""

    means: Floats = field(repr=False)
    covariance: Floats = field(repr=False)


def make_population(
    published: PublishedFigures, space: DesignSpace, targets: Targets, rng: np.random.Generator
) -> Population:
    """Choose means by least change from a flat table, then error variances that give the wanted F's.

    An effect without any known mean gets small random contrasts (none where F = 0 is wanted), one without a
    known F the usual variance.
    """
    means = _cell_means(published, space, targets)
    variances: dict[str, Floats] = {}
    # Names of targets begin with the statistic; effects of the design have the plain name.
    tests = {t.name.removeprefix("F "): t for t in targets.tests}
    for effect, contrasts in space.effects.items():
        q = contrasts.shape[1]
        z = contrasts.T @ means
        target = tests.get(effect)
        # An F below 0.01 counts as no effect: as a ratio it would need huge error variances.
        is_zero = target is not None and target.start is not None and target.start < 0.01
        if is_zero:
            means, z = means - contrasts @ z, np.zeros(q)
        # Printed means say nothing of this effect.
        elif z @ z < 1e-6:
            z = rng.normal(size=q) * published.contrast_sd / np.sqrt(targets.n)
            if published.assumed and target is not None and target.start is not None:
                z *= (
                    # The length of z that gives the wanted F with error variances of contrast_sd squared.
                    np.sqrt(target.start * q / (targets.n - q) * (targets.n - 1) / (z @ z))
                    * published.contrast_sd
                )
                z /= np.sqrt(targets.n)
            means = means + contrasts @ z
        share = published.slope_shares.get(effect, 0.0)
        variances[effect] = _error_variance(z, target, targets.n, published.contrast_sd, share)
    return Population(means, _covariance(published, space, targets, variances))


def _cell_means(published: PublishedFigures, space: DesignSpace, targets: Targets) -> Floats:
    means = np.full(space.n_cells, published.grand_mean)
    # The pseudoinverse gives the least change of the cells that meets the wanted means.
    if published.invented_means:
        rows = np.stack([space.weights(m.at) for m in published.invented_means])
        means = means + np.linalg.pinv(rows) @ (
            np.array([m.mean for m in published.invented_means]) - rows @ means
        )
    # After the invented ones, so that printed means hold where both speak.
    if targets.means:
        rows = np.stack([t.weights for t in targets.means])
        middle = np.array([(t.low + t.high) / 2 for t in targets.means])
        means = means + np.linalg.pinv(rows) @ (middle - rows @ means)
    return np.asarray(means, dtype=np.float64)


def _error_variance(z: Floats, target: TestTarget | None, n: int, sd: float, share: float) -> Floats:
    r"""Covariance (q, q) of an effect's contrasts; `share` of the error is along the effect itself.

    Exact for F with Hotelling's lambda:

    .. math::

        \lambda &= F q / (n - q) = \frac{n}{n - 1} z' V^{-1} z \tag{1} \\
        V &= \rho \{(1 - a) \, z'z \, I + a \, z z'\}, \quad \rho = \frac{n}{n - 1} / \lambda \tag{2}

    z are the contrasts' means (q,), V their covariance, n people, a the share. (2) solves (1) for every a,
    since V z = rho z'z z.
    """
    q = len(z)
    usual = sd**2 * np.eye(q)
    if target is None:
        return usual
    f = target.start
    if f is None:
        present = n / (n - 1) * float(z @ z) / sd**2 * (n - q) / q
        if not target.low <= present <= target.high:
            # Below a bound half of it leaves room for rounding; above one, half more.
            f = target.high * NEVER_ABOVE if present > target.high else max(target.low * 1.5, 1e-6)
    if f is None or f <= 0.01:
        return usual
    ratio = n / (n - 1) / (f * q / (n - q))
    # One contrast: the two terms below coincide, whatever the share.
    if q == 1:
        return np.array([[ratio * float(z @ z)]])
    return (1 - share) * ratio * float(z @ z) * np.eye(q) + share * ratio * np.outer(z, z)


def _covariance(
    published: PublishedFigures, space: DesignSpace, targets: Targets, variances: dict[str, Floats]
) -> Floats:
    """Put grand mean and effects together; wanted SDs of margins fix how effects go with the grand mean."""
    k = space.n_cells
    flat = np.full((k, 1), 1 / np.sqrt(k))
    effects = sum((c @ variances[e] @ c.T for e, c in space.effects.items()), np.zeros((k, k)))
    variances_needed = [
        ((s.low + s.high) / 2) ** 2 - float(s.weights @ effects @ s.weights) for s in targets.spreads
    ]
    # Several printed SDs: the grand mean takes their middle, `together` takes the rest.
    grand = float(np.mean(variances_needed)) if variances_needed else published.grand_sd**2
    together = np.zeros(k)
    if variances_needed:
        # var(margin) = grand + 2 w.c + w'Ew with c the covariance of the cells' effects with the grand mean
        rows = np.stack([s.weights for s in targets.spreads])
        rows = rows - rows.mean(axis=1, keepdims=True)
        together = np.linalg.pinv(rows) @ ((np.array(variances_needed) - grand) / 2)
        # Effects sum to 0 over the cells, and so must their covariances with the grand mean.
        together -= together.mean()
    ones = np.sqrt(k) * flat[:, 0]
    full = grand * np.outer(ones, ones) + np.outer(ones, together) + np.outer(together, ones) + effects
    # Printed figures may ask for a covariance that cannot be: what is negative in it is cut.
    values, vectors = np.linalg.eigh(full)
    return np.asarray((vectors * np.maximum(values, 1e-6)) @ vectors.T, dtype=np.float64)


def draw(population: Population, n: int, rng: np.random.Generator, exact: bool) -> Floats:
    """Draw cell means (n, cells); `exact` makes sample mean and covariance those of the population.

    Exactness needs more participants than cells; with fewer the draw is a plain random one.
    """
    k = len(population.means)
    noise = rng.normal(size=(n, k))
    if exact and n > k:
        # Orthonormal columns with a mean of 0 give the sample exactly the population's covariance.
        noise -= noise.mean(axis=0)
        noise = np.linalg.qr(noise)[0] * np.sqrt(n - 1)
    values, vectors = np.linalg.eigh(population.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(population.means + noise @ root.T, dtype=np.float64)


ATTEMPTS = 40
"""Fresh draws of participants before the best is kept and what it misses is reported."""

WISHED_ATTEMPTS = 6
"""The same for another number of participants or other figures than published: they may have no solution."""


@dataclass(frozen=True)
class ReachedFigure:
    """One wanted figure and what the synthetic data give."""

    name: str
    value: float
    low: float
    high: float

    @property
    def hit(self) -> bool:
        """Whether the value lies in its window."""
        return self.low <= self.value <= self.high


@dataclass(frozen=True)
class Synthetic:
    """Synthetic participants on one scale, and how the wanted figures came out.

    Attributes
    ----------
    sums : int64 array (n, cells)
        Sums of a cell's ratings, counted in steps of the scale.
    """

    experiment: Experiment
    space: DesignSpace
    scale: RatedScale
    seed: int
    trials_per_cell: int
    sums: NDArray[np.int64] = field(repr=False)
    reached: tuple[ReachedFigure, ...]
    given_way: tuple[GivenWay, ...]
    attempts: int

    @property
    def missed(self) -> tuple[ReachedFigure, ...]:
        """Figures that the data do not have."""
        return tuple(figure for figure in self.reached if not figure.hit)

    @property
    def y(self) -> NDArray[np.float64]:
        """Cell means (n, levels of the first factor, ...)."""
        means = ratings_of(self.sums, self.trials_per_cell, Steps.of(self.scale))
        return means.reshape(len(self.sums), *self.space.shape)


@dataclass(frozen=True)
class Plan:
    """What is to be made: the figures, the design and the population behind them."""

    experiment: Experiment
    space: DesignSpace
    published: PublishedFigures
    targets: Targets
    given_way: tuple[GivenWay, ...]
    scale: RatedScale
    as_published: bool = True


def make_plan(
    name: str,
    n: int | None = None,
    means: Sequence[str] = (),
    effects: Sequence[str] = (),
    scale: str | None = None,
) -> Plan:
    """Figures of exp1, exp2 or exp3 with wishes, made jointly possible; of other studies the wishes alone.

    Parameters
    ----------
    name : str
        Of a shipped experiment, or the path of a declaration.
    n : int, optional
        Participants; as declared where not given.
    means, effects : sequence of str
        As in `with_wishes`, each for all scales or, as in `eeriness/character=9`, for one.
    scale : str, optional
        The scale that ratings are of; the first where not given.

    Raises
    ------
    InputError
        No such study or scale; wishes that contradict each other, lie off the scale or name no effect;
        factors between participants; too few participants.
    """
    experiment = load_experiment(name)
    rated = scale_called(experiment, scale)
    space = DesignSpace.of(experiment)
    _refuse_between(experiment, space)
    if name not in SHIPPED and not effects:
        raise InputError(
            f"there are no published figures for '{name}': name the effects that you expect, for example "
            f"--effect {space.factors[0]}=6.5 (F with {experiment.participants} participants)"
        )
    published = load_published(name) if name in SHIPPED else assumed(name, rated)
    people = experiment.participants if n is None else n
    widest = max(c.shape[1] for c in space.effects.values())
    # The multivariate F of q contrasts has N - q error df.
    if people < widest + 2:
        raise InputError(f"expected at least {widest + 2} participants for {name}, got {people}")
    if people != experiment.participants:
        published = _without_p(published)
    means, effects = (wishes_for(experiment, rated, wishes) for wishes in (means, effects))
    published = with_wishes(published, space, means, effects)
    refuse_off_scale(published.means, experiment, rated)
    published, given_way = make_feasible(published, space)
    # Published figures have a known solution, which is worth more attempts.
    as_published = people == experiment.participants and not means and not effects
    targets = make_targets(published, space, people)
    return Plan(experiment, space, published, targets, given_way, rated, as_published)


def _refuse_between(experiment: Experiment, space: DesignSpace) -> None:
    between = [name for name in space.factors if experiment.factor(name).between]
    if between:
        raise InputError(f"expected factors within participants, got '{between[0]}' between them")


def _without_p(published: PublishedFigures) -> PublishedFigures:
    """The figures for another number of participants: a printed F then has another p."""
    tests = tuple(t if t.f is None else t.model_copy(update={"p": None}) for t in published.tests)
    return published.model_copy(update={"tests": tests})


def make_plans(
    name: str, n: int | None = None, means: Sequence[str] = (), effects: Sequence[str] = ()
) -> tuple[Plan, ...]:
    """A plan for every scale of a study, in order; arguments and errors are those of `make_plan`."""
    scales = scales_of(load_experiment(name))
    # A study without scales fails in `make_plan`, with a message.
    return tuple(make_plan(name, n, means, effects, scale.name) for scale in scales) or (
        make_plan(name, n, means, effects),
    )


def ratings_of(sums: NDArray[np.int64], trials: int, steps: Steps) -> NDArray[np.float64]:
    """Mean ratings of sums that are counted in steps."""
    return steps.offset + steps.size * (sums / trials)


def population_of(plan: Plan, rng: np.random.Generator) -> Population:
    """Means and covariance that give the plan's figures."""
    return make_population(plan.published, plan.space, plan.targets, rng)


def synthesise(plan: Plan, seed: int, progress: Callable[[int, int], None] | None = None) -> Synthetic:
    """Draw participants and adjust them until every figure holds; otherwise return the best draw.

    The scales of a study are drawn independently: equal seeds give no equal people on two of them.
    `progress` gets (figures missed, rounds done).
    """
    rng = np.random.default_rng(_seed_of(plan, seed))
    # One cell mean is the mean of so many ratings.
    trials = plan.experiment.exemplars.per_cell * plan.experiment.blocks.repeats
    steps = Steps.of(plan.scale)
    targets = steps.targets(plan.targets)
    repaired: list[RepairedSums] = []
    rounds = 0
    attempts = ATTEMPTS if plan.as_published else WISHED_ATTEMPTS
    while len(repaired) < attempts and not any(not f.missed for f in repaired):
        # The repair works on whole numbers of steps, not in units of the scale.
        start = (draw(population_of(plan, rng), targets.n, rng, exact=True) - steps.offset) / steps.size
        ends = (steps.low, steps.high)
        repaired.append(repair(start, trials, ends, targets, rng, _onward(progress, rounds)))
        rounds += repaired[-1].steps
    best = min(repaired, key=lambda f: len(f.missed))
    y = ratings_of(best.sums, trials, steps)
    # Checked again in units of the scale, as a reader of the data would.
    reached = tuple(ReachedFigure(t.name, value_of(y, t), t.low, t.high) for t in plan.targets.everything)
    return Synthetic(
        plan.experiment,
        plan.space,
        plan.scale,
        seed,
        trials,
        best.sums,
        reached,
        plan.given_way,
        len(repaired),
    )


def _seed_of(plan: Plan, seed: int) -> list[int]:
    """The first scale's is that of a study with one; [seed, 1] is that of single ratings."""
    position = scales_of(plan.experiment).index(plan.scale)
    return [seed] if position == 0 else [seed, 1 + position]


def _onward(progress: Callable[[int, int], None] | None, rounds: int) -> Callable[[int, int], None] | None:
    if progress is None:
        return None
    return lambda missed, step: progress(missed, rounds + step)
