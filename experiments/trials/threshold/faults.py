"""What in a declared threshold does not fit the rest of the experiment, in one line with what to do."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from experiments.errors import did_you_mean
from experiments.trials.threshold.declaration import Range, Stimulus, Threshold, TwoInterval

if TYPE_CHECKING:
    from experiments.definition import Experiment

MAX_TRIALS = 2000


def fault(experiment: "Experiment", trial: Threshold) -> str | None:
    """The first fault; None where all is well."""
    return next(_faults(experiment, trial), None)


def _faults(experiment: "Experiment", trial: Threshold) -> Iterator[str]:
    factor, names = trial.stimulus.factor, experiment.factor_names
    if factor not in names:
        yield f"trial.stimulus.factor: no factor is called '{factor}'{did_you_mean(factor, names)}"
        return
    yield from _stimulus_faults(experiment, trial)
    yield from _stop_faults(experiment, trial)
    yield from _series_faults(experiment, trial)


def _stimulus_faults(experiment: "Experiment", trial: Threshold) -> Iterator[str]:
    factor = trial.stimulus.factor
    levels = [level.name for level in experiment.factor(factor).levels]
    for name in trial.stimulus.values:
        if name not in levels:
            yield f"trial.stimulus.values: '{factor}' has no level '{name}'{did_you_mean(name, levels)}"
    if isinstance(trial.task, TwoInterval) and trial.task.standard not in levels:
        near = did_you_mean(trial.task.standard, levels)
        yield f"trial.task.standard: '{factor}' has no level '{trial.task.standard}'{near}"
    numbers: dict[float, str] = {}
    for name in tested(trial, levels):
        number = number_of(trial.stimulus, name)
        if number is None:
            yield (
                f"trial.stimulus: expected a number for every level of '{factor}', got the level '{name}'; "
                "name levels by their numbers, or give each one in trial.stimulus.values"
            )
            return
        if number in numbers:
            yield f"trial.stimulus: levels '{numbers[number]}' and '{name}' have the same number {number:g}"
        numbers[number] = name
    if len(numbers) < 2:
        yield f"trial.stimulus: expected two stimuli or more, got {len(numbers)} level of '{factor}'"
    yield from _function_faults(trial, min(numbers, default=0.0))


def _function_faults(trial: Threshold, lowest: float) -> Iterator[str]:
    if trial.task.guess + trial.lapse >= 1:
        yield (
            f"trial.lapse: guess {trial.task.guess:g} and lapse {trial.lapse:g} leave nothing between them; "
            "together they must be below 1"
        )
    if trial.function == "weibull" and (trial.direction == "falling" or lowest <= 0):
        what = "a falling function" if trial.direction == "falling" else f"the stimulus {lowest:g}"
        yield f"trial.function: expected stimuli above 0 and a rising function for weibull, got {what}"
    thresholds: Range | None = trial.thresholds if trial.function == "weibull" else None
    for key, numbers in (("thresholds", thresholds), ("spreads", trial.spreads)):
        if numbers is not None and numbers.lowest <= 0:
            yield f"trial.{key}.lowest: expected a number above 0, got {numbers.lowest:g}"


def _stop_faults(experiment: "Experiment", trial: Threshold) -> Iterator[str]:
    stop, repeats, split = trial.stop, experiment.blocks.repeats, experiment.blocks.split_by
    if stop.trials is None:
        yield (
            "trial.stop.trials: expected the most trials of a series; by its certainty alone a series might "
            "never end"
        )
        return
    early = stop.sd is not None or stop.entropy is not None
    if early and stop.at_least >= stop.trials:
        yield (
            f"trial.stop.at_least: expected fewer than the {stop.trials} trials of a series, got "
            f"{stop.at_least}, so that sd and entropy never end one"
        )
    if stop.trials % repeats:
        yield (
            f"trial.stop.trials: {stop.trials} trials of a series do not divide into {repeats} blocks; "
            f"give a multiple of {repeats}"
        )
    if split == trial.stimulus.factor:
        yield f"blocks.split_by: '{split}' is what each series moves along; split by another factor, or not"


def _series_faults(experiment: "Experiment", trial: Threshold) -> Iterator[str]:
    others = {
        factor.name: [level.name for level in factor.levels]
        for factor in experiment.factors
        if factor.name != trial.stimulus.factor
    }
    names = [series.name for series in trial.series]
    for place, one in enumerate(trial.series):
        here = f"trial.series: '{one.name}'"
        if one.name in names[:place]:
            yield f"{here} is declared twice"
        for factor, level in one.levels.items():
            if factor == trial.stimulus.factor:
                yield f"{here}: '{factor}' is what the series moves along and has no level of its own"
            elif factor not in others:
                yield f"{here}: no factor is called '{factor}'{did_you_mean(factor, others)}"
            elif level not in others[factor]:
                near = did_you_mean(level, others[factor])
                yield f"{here}: '{factor}' has no level '{level}'{near}"
        missing = [name for name in others if name not in one.levels]
        if missing:
            yield f"{here}: expected a level of '{missing[0]}', got none"
    count = len(trial.series) or math.prod(len(levels) for levels in others.values())
    if count * (trial.stop.trials or 0) > MAX_TRIALS:
        yield (
            f"trial.series: {count} series of {trial.stop.trials} trials are more than {MAX_TRIALS} for one "
            "person; declare fewer series, or fewer trials"
        )


def tested(trial: Threshold, levels: list[str]) -> list[str]:
    """The levels that are stimuli: all but the standard."""
    standard = trial.task.standard if isinstance(trial.task, TwoInterval) else None
    return [level for level in levels if level != standard]


def number_of(stimulus: Stimulus, level: str) -> float | None:
    """The number of a level: that declared, or the one it is named by; None where it has none."""
    if level in stimulus.values:
        return stimulus.values[level]
    try:
        number = float(level)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
