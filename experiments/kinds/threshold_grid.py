"""The rendered grid as adaptive series see it, and checks of a declared threshold."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Literal, NamedTuple, TypeVar

from experiments.assignment.groups import groups, name_of
from experiments.declaration.experiment import Experiment
from experiments.declaration.threshold import Range, Series, Threshold, TwoInterval, threshold_of
from experiments.declaration.trial import ClipSpec
from experiments.errors import did_you_mean

# Checks of a declared threshold against the rest of the experiment, in one line with what to do.

MAX_TRIALS = 2000
MAX_TABLE = 500_000
"""Number of stimuli times number of considered parameters: each choice evaluates all of them."""


# Decision 0660: A threshold can be a line over a second factor.
def fault(experiment: Experiment) -> str | None:
    """The first fault; None if everything fits."""
    return next(_faults(experiment, threshold_of(experiment)), None)


def _faults(experiment: Experiment, trial: Threshold) -> Iterator[str]:
    names = experiment.factor_names
    for path, factor in zip(("factor", "second.factor"), trial.stimulus.factors, strict=False):
        if factor not in names:
            yield f"trial.stimulus.{path}: no factor is called '{factor}'{did_you_mean(factor, names)}"
            return
        if experiment.factor(factor).between:
            yield (
                f"trial.stimulus.{path}: '{factor}' is between participants, but a series moves within one "
                f"participant; remove `between` from it"
            )
    yield from _stimulus_faults(experiment, trial)
    yield from _second_faults(experiment, trial)
    yield from _table_faults(experiment)
    yield from _stop_faults(experiment, trial)
    yield from _series_faults(experiment, trial)
    yield from _group_faults(experiment)


def _stimulus_faults(experiment: Experiment, trial: Threshold) -> Iterator[str]:
    factor = trial.stimulus.factor
    levels = [level.name for level in experiment.factor(factor).levels]
    yield from _level_faults("trial.stimulus.values", factor, trial.stimulus.values, levels)
    if isinstance(trial.task, TwoInterval):
        yield from _level_faults("trial.task.standard", factor, [trial.task.standard], levels)
    yield from _number_faults("trial.stimulus", factor, trial.stimulus.values, tested_levels(trial, levels))
    numbers = [number_of(trial.stimulus.values, name) for name in tested_levels(trial, levels)]
    yield from _function_faults(trial, min((one for one in numbers if one is not None), default=0.0))


def _level_faults(path: str, factor: str, named: Iterable[str], levels: Sequence[str]) -> Iterator[str]:
    for name in named:
        if name not in levels:
            yield f"{path}: '{factor}' has no level '{name}'{did_you_mean(name, levels)}"


def _number_faults(
    path: str, factor: str, values: Mapping[str, float], levels: Sequence[str]
) -> Iterator[str]:
    """What is wrong with the numbers of a factor's levels."""
    numbers: dict[float, str] = {}
    for name in levels:
        number = number_of(values, name)
        if number is None:
            yield (
                f"{path}: expected a number for every level of '{factor}', got the level '{name}'; "
                f"use numbers as level names, or set the number of each level in {path}.values"
            )
            return
        if number in numbers:
            yield f"{path}: levels '{numbers[number]}' and '{name}' have the same number {number:g}"
        numbers[number] = name
    if len(numbers) < 2:
        yield f"{path}: expected two stimuli or more, got {len(numbers)} level of '{factor}'"


def _second_faults(experiment: Experiment, trial: Threshold) -> Iterator[str]:
    """What does not fit with a second factor, and what needs one."""
    second, task = trial.stimulus.second, trial.task
    beside = task.standard_second if isinstance(task, TwoInterval) else None
    if second is None:
        for path, given in (("tilts", trial.tilts), ("task.standard_second", beside)):
            if given is not None:
                yield f"trial.{path}: add trial.stimulus.second, or remove this key"
        return
    levels = [level.name for level in experiment.factor(second.factor).levels]
    if second.factor == trial.stimulus.factor:
        yield (
            f"trial.stimulus.second.factor: '{second.factor}' is already the first factor; use another factor"
        )
    yield from _level_faults("trial.stimulus.second.values", second.factor, second.values, levels)
    yield from _number_faults("trial.stimulus.second", second.factor, second.values, levels)
    if beside is not None:
        yield from _level_faults("trial.task.standard_second", second.factor, [beside], levels)
    if trial.function != "normal":
        yield (
            f"trial.function: expected normal with a second factor, because its thresholds may cross 0; got "
            f"{trial.function}"
        )


def _table_faults(experiment: Experiment) -> Iterator[str]:
    """More stimuli and parameters than can be evaluated for every trial."""

    assumed = model(experiment)
    parameters = len(assumed.thresholds) * len(assumed.spreads) * max(1, len(assumed.tilts))
    stimuli = len(points(experiment))
    if (size := stimuli * parameters) > MAX_TABLE:
        yield (
            f"trial.thresholds: {stimuli} stimuli times {parameters} sets of thresholds, "
            f"spreads and tilts make {size} combinations, expected at most {MAX_TABLE}; reduce their steps"
        )


def _group_faults(experiment: Experiment) -> Iterator[str]:
    """A group of participants without a declared series."""

    for levels in groups(experiment):
        if not series_in_group(experiment, levels):
            yield (
                f"trial.series: the group '{name_of(levels)}' has no series; declare one with its level, "
                f"or remove trial.series"
            )


def _function_faults(trial: Threshold, lowest: float) -> Iterator[str]:
    if trial.task.guess + trial.lapse >= 1:
        yield (
            f"trial.lapse: guess {trial.task.guess:g} and lapse {trial.lapse:g} leave no range between "
            f"them; their sum must be below 1"
        )
    if trial.function == "weibull" and (trial.direction == "falling" or lowest <= 0):
        what = "a falling function" if trial.direction == "falling" else f"the stimulus {lowest:g}"
        yield f"trial.function: expected stimuli above 0 and a rising function for weibull, got {what}"
    thresholds: Range | None = trial.thresholds if trial.function == "weibull" else None
    for key, numbers in (("thresholds", thresholds), ("spreads", trial.spreads)):
        if numbers is not None and numbers.lowest <= 0:
            yield f"trial.{key}.lowest: expected a number above 0, got {numbers.lowest:g}"


def _stop_faults(experiment: Experiment, trial: Threshold) -> Iterator[str]:
    stop, repeats, split = trial.stop, experiment.blocks.repeats, experiment.blocks.split_by
    if stop.trials is None:
        yield (
            "trial.stop.trials is required: a maximum number of trials, because precision alone might "
            "never end a series"
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
            f"trial.stop.trials: {stop.trials} trials of a series cannot be divided into {repeats} blocks; "
            f"use a multiple of {repeats}"
        )
    if split in trial.stimulus.factors:
        yield (
            f"blocks.split_by: '{split}' is the stimulus factor of each series; split by another factor, "
            f"or remove split_by"
        )


def _series_faults(experiment: Experiment, trial: Threshold) -> Iterator[str]:
    others = {
        factor.name: [level.name for level in factor.levels]
        for factor in experiment.factors
        if factor.name not in trial.stimulus.factors
    }
    names = [series.name for series in trial.series]
    for position, one in enumerate(trial.series):
        here = f"trial.series: '{one.name}'"
        if one.name in names[:position]:
            yield f"{here} is declared twice"
        for factor, level in one.levels.items():
            if factor in trial.stimulus.factors:
                yield f"{here}: '{factor}' is the stimulus factor of the series; remove its level"
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
            f"trial.series: {count} series of {trial.stop.trials} trials exceed {MAX_TRIALS} trials per "
            f"participant; use fewer series, or fewer trials"
        )


def tested_levels(trial: Threshold, levels: list[str]) -> list[str]:
    """The levels that are stimuli: all but the standard."""
    standard = trial.task.standard if isinstance(trial.task, TwoInterval) else None
    return [level for level in levels if level != standard]


def standard_doubt(experiment: Experiment) -> str | None:
    """Stimuli on the wrong side of a standard with a number: fewer than half choose them.

    The function of two intervals begins at one half, so no threshold describes such answers.
    """
    trial = threshold_of(experiment)
    if not isinstance(trial.task, TwoInterval):
        return None
    standard = number_of(trial.stimulus.values, trial.task.standard)
    levels = [level.name for level in experiment.factor(trial.stimulus.factor).levels]
    numbers = [number_of(trial.stimulus.values, name) for name in tested_levels(trial, levels)]
    rising = trial.direction == "rising"
    if standard is None:
        return None
    wrong = sorted(one for one in numbers if one is not None and (one < standard) == rising)
    if not wrong:
        return None
    named = f"{'stimulus' if len(wrong) == 1 else 'stimuli'} {', '.join(f'{one:g}' for one in wrong)}"
    return (
        f"trial.task.standard: expected a standard {'below' if rising else 'above'} all stimuli, got "
        f"{standard:g} with the {named}; a {trial.direction} function of two intervals begins at one half, "
        f"but people choose such stimuli less often"
    )


def number_of(values: Mapping[str, float], level: str) -> float | None:
    """The number of a level: that declared, or the one it is named by; None where it has none."""
    if level in values:
        return values[level]
    try:
        number = float(level)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


# The rendered grid as series see it: stimuli with their numbers, and the assumed function of QUEST+.

Key = TypeVar("Key")


class Point(NamedTuple):
    """A stimulus: its number along the factor, and along the second where there is one."""

    value: float
    second: float | None = None


class Model(NamedTuple):
    """The psychometric function that a series assumes, and the parameters it considers.

    P(x) = guess + (1 - guess - lapse) F(x), F the normal distribution function of mean `threshold` and SD
    `spread`, or the Weibull 1 - exp(-(x / threshold)^spread). Where it falls, x and threshold change sign.
    With `seconds`, z of them, the mean is threshold + tilt (z - middle); see `middle`.
    """

    function: Literal["normal", "weibull"]
    falling: bool
    stimuli: tuple[float, ...]
    thresholds: tuple[float, ...]
    spreads: tuple[float, ...]
    guess: float
    lapse: float
    seconds: tuple[float, ...] = ()
    tilts: tuple[float, ...] = ()

    @property
    def middle(self) -> float:
        """The number of the second factor at which `threshold` is the threshold: between its ends."""
        return (self.seconds[0] + self.seconds[-1]) / 2 if self.seconds else 0.0


def stimuli(experiment: Experiment) -> dict[float, str]:
    """Level of the stimulus factor by its number, in ascending order."""
    trial = threshold_of(experiment)
    levels = [level.name for level in experiment.factor(trial.stimulus.factor).levels]
    return _by_number(trial.stimulus.values, tested_levels(trial, levels))


def seconds(experiment: Experiment) -> dict[float, str]:
    """Level of the second factor by its number, ascending; empty where series move along one."""
    second = threshold_of(experiment).stimulus.second
    if second is None:
        return {}
    return _by_number(second.values, (level.name for level in experiment.factor(second.factor).levels))


def _by_number(values: Mapping[str, float], levels: Iterable[str]) -> dict[float, str]:
    numbers = {number_of(values, level): level for level in levels}
    return dict(sorted((number, level) for number, level in numbers.items() if number is not None))


def points(experiment: Experiment) -> dict[Point, dict[str, str]]:
    """Levels of each stimulus, those of the second factor slowest."""
    factors = threshold_of(experiment).stimulus.factors
    along, across = stimuli(experiment), seconds(experiment)
    if not across:
        return {Point(value): {factors[0]: level} for value, level in along.items()}
    return {
        Point(value, second): {factors[0]: level, factors[1]: other}
        for second, other in across.items()
        for value, level in along.items()
    }


def points_of(experiment: Experiment, clips: Mapping[Key, Mapping[str, str]]) -> dict[Key, Point]:
    """The stimulus that each clip is, by the clip's levels; standards are left out."""
    factors = threshold_of(experiment).stimulus.factors
    by_levels = {
        tuple(levels[name] for name in factors): point for point, levels in points(experiment).items()
    }
    named = {clip: tuple(levels[name] for name in factors) for clip, levels in clips.items()}
    return {clip: by_levels[levels] for clip, levels in named.items() if levels in by_levels}


def model(experiment: Experiment) -> Model:
    """The declared function with its defaults filled in."""
    trial, numbers, across = threshold_of(experiment), tuple(stimuli(experiment)), tuple(seconds(experiment))
    low, high = numbers[0], numbers[-1]
    weibull = trial.function == "weibull"
    usual = Range(lowest=1, highest=10, steps=10)
    if not weibull:
        usual = Range(lowest=(high - low) / 20, highest=(high - low) / 2, steps=6 if across else 10)
    tilts: tuple[float, ...] = ()
    if across:
        steepest = (high - low) / (across[-1] - across[0])
        tilts = (trial.tilts or Range(lowest=-steepest, highest=steepest, steps=11)).numbers
    return Model(
        trial.function,
        trial.direction == "falling",
        numbers,
        (trial.thresholds or Range(lowest=low, highest=high)).numbers,
        (trial.spreads or usual).numbers,
        trial.task.guess,
        trial.lapse,
        across,
        tilts,
    )


def series_of(experiment: Experiment) -> tuple[Series, ...]:
    """The declared series; if there are none, one per combination of the other factors' levels."""
    trial = threshold_of(experiment)
    if trial.series:
        return trial.series
    others = [factor for factor in experiment.factors if factor.name not in trial.stimulus.factors]
    combinations = product(*([(factor.name, level.name) for level in factor.levels] for factor in others))
    return tuple(
        Series(name=f"s{number}", levels=dict(levels)) for number, levels in enumerate(combinations, start=1)
    )


def series_in_group(experiment: Experiment, levels: Iterable[tuple[str, str]]) -> tuple[Series, ...]:
    """The series of a group of participants: those whose levels match the group."""
    mine = set(levels)
    return tuple(one for one in series_of(experiment) if mine <= set(one.levels.items()))


def clip_of(
    experiment: Experiment, levels: Mapping[str, str], stimulus: Mapping[str, str], exemplar: int
) -> ClipSpec:
    """The clip of the grid with these levels of a series and of a stimulus."""
    every = {**levels, **stimulus}
    return ClipSpec(tuple((name, every[name]) for name in experiment.factor_names), exemplar)


def exemplar_at(experiment: Experiment, position: int) -> int:
    """Exemplar of the clips at a position (from 1) of a series: exemplars rotate, whatever the stimulus."""
    return 1 + position % experiment.exemplars.per_cell


def standard_of(trial: Threshold) -> str | None:
    """The level shown for comparison; None if one clip is shown."""
    return trial.task.standard if isinstance(trial.task, TwoInterval) else None


def standard_beside(trial: Threshold, stimulus: Mapping[str, str]) -> dict[str, str] | None:
    """Levels of the clip that this stimulus is compared with; None if one clip is shown."""
    task = trial.task
    if not isinstance(task, TwoInterval):
        return None
    levels = {**stimulus, trial.stimulus.factor: task.standard}
    if trial.stimulus.second and task.standard_second is not None:
        levels[trial.stimulus.second.factor] = task.standard_second
    return levels
