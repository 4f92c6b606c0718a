"""Which series has its turn when, and what stands there until the server has chosen."""

import random
from collections.abc import Iterable
from typing import TYPE_CHECKING

from experiments.assignment.groups import groups, name_of, seat_of
from experiments.assignment.order import ordered_blocks, with_attention
from experiments.assignment.trial import Shown, Trial
from experiments.trials.declared import BlockSpec
from experiments.trials.threshold.declaration import Series, Stop, threshold_of
from experiments.trials.threshold.grid import (
    clip_of,
    exemplar_at,
    model,
    points,
    series_in_group,
    series_of,
    standard_beside,
    standard_of,
)

if TYPE_CHECKING:
    from experiments.definition import Experiment


def assign(experiment: "Experiment", seed: int, slot: int) -> list[Trial]:
    """The trials of one participant in order, as many of each series as it may have.

    Series take turns in rounds, in an order drawn for each. The stimuli are a plan without answers (levels
    spread evenly over the grid); the server puts its choices in their place, the first before the run begins.

    Parameters
    ----------
    seed : int
        Of practice, order of series and intervals.
    slot : int
        Place in the counterbalancing, for the group of participants and the blocks.
    """
    rng, seat = random.Random(seed), seat_of(experiment, slot)
    mine, levels = list(series_in_group(experiment, seat.levels)), list(points(experiment).values())
    trials = [_practice(experiment, mine, rng) for _ in range(experiment.practice.trials)]
    done = dict.fromkeys((one.name for one in mine), 0)
    for number, block in enumerate(ordered_blocks(experiment, rng, seat.number), start=1):
        main: list[Trial] = []
        here = _series_in(experiment, block, mine)
        for _ in range(_trials_a_block(experiment)):
            if experiment.blocks.trial_order == "random":
                rng.shuffle(here)
            for one in here:
                position = done[one.name]
                done[one.name] += 1
                shown = _shown(
                    experiment, one, _spread(levels, position), exemplar_at(experiment, position + 1), rng
                )
                main.append(Trial("main", number, block.label, shown, series=one.name))
        if main:
            trials.extend(with_attention(experiment, main, rng, lambda draw: draw.randint(1, 2)))
    return trials


def _practice(experiment: "Experiment", mine: list[Series], rng: random.Random) -> Trial:
    """A stimulus drawn from the whole grid, so that plain and faint ones are met before they count."""
    one = rng.choice(mine)
    level = rng.choice(list(points(experiment).values()))
    exemplar = rng.randint(1, experiment.exemplars.per_cell)
    return Trial("practice", 0, "practice", _shown(experiment, one, level, exemplar, rng))


def _shown(
    experiment: "Experiment", one: Series, stimulus: dict[str, str], exemplar: int, rng: random.Random
) -> tuple[Shown, ...]:
    trial = threshold_of(experiment)
    standard = standard_beside(trial, stimulus)
    levels = [stimulus] if standard is None else [stimulus, standard]
    if rng.random() < 0.5:
        levels.reverse()
    clips = [clip_of(experiment, one.levels, name, exemplar) for name in levels]
    return tuple(Shown(role, clip) for role, clip in zip(trial.roles, clips, strict=True))


def _spread(levels: list[dict[str, str]], position: int) -> dict[str, str]:
    """The stimuli in van der Corput's order of base 2: any run of places covers the grid evenly."""
    share, weight = 0.0, 0.5
    number = position + 1
    while number:
        share += weight * (number & 1)
        number >>= 1
        weight /= 2
    return levels[int(share * len(levels))]


def _series_in(experiment: "Experiment", block: BlockSpec, every: Iterable[Series]) -> list[Series]:
    split = experiment.blocks.split_by
    return [one for one in every if split is None or one.levels[split] == block.label]


def _trials_a_block(experiment: "Experiment") -> int:
    """Trials of one series in one block: all of them, divided over the repeated blocks."""
    return (threshold_of(experiment).stop.trials or 0) // experiment.blocks.repeats


def block_size(experiment: "Experiment", block: BlockSpec) -> int:
    """Most trials of a participant in a block: those of every series in it, of the group with most."""
    each = (series_in_group(experiment, levels) for levels in groups(experiment))
    return max(len(_series_in(experiment, block, mine)) for mine in each) * _trials_a_block(experiment)


def plan(experiment: "Experiment") -> tuple[str, ...]:
    """Series, stimuli, what is looked for and when it ends, in words."""
    trial, assumed, every = threshold_of(experiment), model(experiment), series_of(experiment)
    standard = standard_of(trial)
    task = f"against the standard {standard}" if standard else "yes or no"
    named = ", ".join(f"{one.name} ({'/'.join(one.levels.values()) or 'all'})" for one in every)
    numbers, across = assumed.stimuli, assumed.seconds
    grid = f"{trial.stimulus.factor}: {len(numbers)} stimuli from {numbers[0]:g} to {numbers[-1]:g}"
    if trial.stimulus.second:
        grid += (
            f", times {len(across)} of {trial.stimulus.second.factor} from {across[0]:g} to {across[-1]:g}, "
            f"tilts from {assumed.tilts[0]:g} to {assumed.tilts[-1]:g}"
        )
    between = [(name_of(levels), series_in_group(experiment, levels)) for levels in groups(experiment)]
    length = _length(trial.stop, max(len(mine) for _, mine in between))
    return (
        f"{len(every)} adaptive series, interleaved: {named}",
        *(
            f"group {name}: {', '.join(one.name for one in mine)}"
            for name, mine in between
            if len(between) > 1
        ),
        f"each moves along {grid}, {task}",
        f"thresholds from {assumed.thresholds[0]:g} to {assumed.thresholds[-1]:g} are considered; guess "
        f"{assumed.guess:g}, lapse {assumed.lapse:g}",
        f"{length}; up to {trial.ahead} trials of a series without connection",
    )


def _length(stop: Stop, series: int) -> str:
    longest = stop.trials or 0
    rules = [f"SD {stop.sd:g}"] if stop.sd is not None else []
    rules += [f"entropy {stop.entropy:g} bit"] if stop.entropy is not None else []
    if not rules:
        return f"{longest} trials a series, {longest * series} a participant"
    shortest = min(stop.at_least, longest)
    return (
        f"{shortest} to {longest} trials a series, {shortest * series} to {longest * series} a participant: "
        f"it ends at {' and '.join(rules)}"
    )
