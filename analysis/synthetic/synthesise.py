"""Make the ratings of synthetic participants that give published (or wished) figures."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.synthetic.feasible import GivenWay, make_feasible
from analysis.synthetic.moves import value_of
from analysis.synthetic.population import Population, draw, make_population
from analysis.synthetic.published import Published, load_published
from analysis.synthetic.repair import Missed, Repaired, repair
from analysis.synthetic.space import DesignSpace
from analysis.synthetic.targets import Targets, make_targets
from analysis.synthetic.trials import rating_rows
from analysis.synthetic.wishes import with_wishes
from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.files import whole_file
from experiments.load import load_experiment
from experiments.trials.clip_rating.columns import RATINGS
from experiments.trials.scales import scale_called

ATTEMPTS = 40
"""Fresh draws of participants before the best is kept and what it misses is reported."""

WISHED_ATTEMPTS = 6
"""The same for another number of participants or other figures than published: they may have no solution."""


@dataclass(frozen=True)
class Reached:
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
    """Synthetic participants: cell sums (n, cells) and how the wanted figures came out."""

    experiment: Experiment
    space: DesignSpace
    seed: int
    trials_per_cell: int
    sums: NDArray[np.int64] = field(repr=False)
    reached: tuple[Reached, ...]
    missed: tuple[Missed, ...]
    given_way: tuple[GivenWay, ...]
    attempts: int

    @property
    def y(self) -> NDArray[np.float64]:
        """Cell means (n, levels of the first factor, ...)."""
        return (self.sums / self.trials_per_cell).reshape(len(self.sums), *self.space.shape)


@dataclass(frozen=True)
class Plan:
    """What is to be made: the figures, the design and the population behind them."""

    experiment: Experiment
    space: DesignSpace
    published: Published
    targets: Targets
    given_way: tuple[GivenWay, ...]
    as_published: bool = True


def make_plan(
    name: str, n: int | None = None, means: Sequence[str] = (), effects: Sequence[str] = ()
) -> Plan:
    """Figures of exp1, exp2 or exp3 with the user's wishes, made jointly possible."""
    published = load_published(name)
    experiment = load_experiment(published.experiment)
    space = DesignSpace.of(experiment)
    people = experiment.participants if n is None else n
    widest = max(c.shape[1] for c in space.effects.values())
    if people < widest + 2:
        raise InputError(f"expected at least {widest + 2} participants for {name}, got {people}")
    if people != experiment.participants:
        published = _without_p(published)
    published, given_way = make_feasible(with_wishes(published, space, means, effects), space)
    as_published = people == experiment.participants and not means and not effects
    targets = make_targets(published, space, people)
    return Plan(experiment, space, published, targets, given_way, as_published)


def _without_p(published: Published) -> Published:
    """The figures for another number of participants: a printed F then has another p."""
    tests = tuple(t if t.f is None else t.model_copy(update={"p": None}) for t in published.tests)
    return published.model_copy(update={"tests": tests})


def population_of(plan: Plan, rng: np.random.Generator) -> Population:
    """Means and covariance that give the plan's figures."""
    return make_population(plan.published, plan.space, plan.targets, rng)


def synthesise(plan: Plan, seed: int, progress: Callable[[int, int], None] | None = None) -> Synthetic:
    """Draw participants and mend them until every figure holds; the best of some draws where none does.

    `progress` gets (figures missed, rounds done).
    """
    rng = np.random.default_rng(seed)
    trials = plan.experiment.exemplars.per_cell * plan.experiment.blocks.repeats
    declared = scale_called(plan.experiment)
    scale = (round(declared.minimum), round(declared.maximum))
    found: list[Repaired] = []
    rounds = 0
    attempts = ATTEMPTS if plan.as_published else WISHED_ATTEMPTS
    while len(found) < attempts and not any(not f.missed for f in found):
        start = draw(population_of(plan, rng), plan.targets.n, rng, exact=True)
        found.append(repair(start, trials, scale, plan.targets, rng, _onward(progress, rounds)))
        rounds += found[-1].steps
    best = min(found, key=lambda f: len(f.missed))
    y = best.sums / trials
    reached = tuple(Reached(t.name, value_of(y, t), t.low, t.high) for t in plan.targets.everything)
    return Synthetic(
        plan.experiment,
        plan.space,
        seed,
        trials,
        best.sums,
        reached,
        best.missed,
        plan.given_way,
        len(found),
    )


def _onward(progress: Callable[[int, int], None] | None, rounds: int) -> Callable[[int, int], None] | None:
    if progress is None:
        return None
    return lambda missed, step: progress(missed, rounds + step)


def write_ratings(synthetic: Synthetic, out: Path) -> int:
    """Write the ratings as the server's CSV export, every row marked synthetic; the number of rows."""
    header = RATINGS.csv_header(synthetic.experiment.factor_names)
    rng = np.random.default_rng([synthetic.seed, 1])
    count = 0
    with whole_file(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.DictWriter(handle, header, lineterminator="\n")
        writer.writeheader()
        for row in rating_rows(synthetic.experiment, synthetic.space, synthetic.sums, rng):
            writer.writerow(row)
            count += 1
    return count
