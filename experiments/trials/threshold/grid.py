"""The rendered grid as series see it: stimuli with their numbers, and what QUEST+ is told of a function."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeVar

from experiments.trials.declared import ClipSpec
from experiments.trials.threshold.declaration import Range, Series, Threshold, TwoInterval, threshold_of
from experiments.trials.threshold.faults import number_of, tested

if TYPE_CHECKING:
    from experiments.definition import Experiment

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


def stimuli(experiment: "Experiment") -> dict[float, str]:
    """Level of the stimulus factor by its number, ascending."""
    trial = threshold_of(experiment)
    levels = [level.name for level in experiment.factor(trial.stimulus.factor).levels]
    return _by_number(trial.stimulus.values, tested(trial, levels))


def seconds(experiment: "Experiment") -> dict[float, str]:
    """Level of the second factor by its number, ascending; empty where series move along one."""
    second = threshold_of(experiment).stimulus.second
    if second is None:
        return {}
    return _by_number(second.values, (level.name for level in experiment.factor(second.factor).levels))


def _by_number(values: Mapping[str, float], levels: Iterable[str]) -> dict[float, str]:
    numbers = {number_of(values, level): level for level in levels}
    return dict(sorted((number, level) for number, level in numbers.items() if number is not None))


def points(experiment: "Experiment") -> dict[Point, dict[str, str]]:
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


def points_of(experiment: "Experiment", clips: Mapping[Key, Mapping[str, str]]) -> dict[Key, Point]:
    """The stimulus that each clip is, by the clip's levels; standards are left out."""
    factors = threshold_of(experiment).stimulus.factors
    by_levels = {
        tuple(levels[name] for name in factors): point for point, levels in points(experiment).items()
    }
    named = {clip: tuple(levels[name] for name in factors) for clip, levels in clips.items()}
    return {clip: by_levels[levels] for clip, levels in named.items() if levels in by_levels}


def model(experiment: "Experiment") -> Model:
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


def series_of(experiment: "Experiment") -> tuple[Series, ...]:
    """The declared series; where none is, one a combination of the other factors' levels."""
    trial = threshold_of(experiment)
    if trial.series:
        return trial.series
    others = [factor for factor in experiment.factors if factor.name not in trial.stimulus.factors]
    combinations = product(*([(factor.name, level.name) for level in factor.levels] for factor in others))
    return tuple(
        Series(name=f"s{number}", levels=dict(levels)) for number, levels in enumerate(combinations, start=1)
    )


def series_in_group(experiment: "Experiment", levels: Iterable[tuple[str, str]]) -> tuple[Series, ...]:
    """The series that a group of participants runs: those whose levels are the group's."""
    mine = set(levels)
    return tuple(one for one in series_of(experiment) if mine <= set(one.levels.items()))


def clip_of(
    experiment: "Experiment", levels: Mapping[str, str], stimulus: Mapping[str, str], exemplar: int
) -> ClipSpec:
    """The clip of the grid with these levels of a series and of a stimulus."""
    every = {**levels, **stimulus}
    return ClipSpec(tuple((name, every[name]) for name in experiment.factor_names), exemplar)


def exemplar_at(experiment: "Experiment", position: int) -> int:
    """Exemplar of the clips at a place (from 1) of a series: they go round, whatever the stimulus is."""
    return 1 + position % experiment.exemplars.per_cell


def standard_of(trial: Threshold) -> str | None:
    """The level shown for comparison; None where one clip is shown."""
    return trial.task.standard if isinstance(trial.task, TwoInterval) else None


def standard_beside(trial: Threshold, stimulus: Mapping[str, str]) -> dict[str, str] | None:
    """Levels of the clip that this stimulus is shown against; None where one clip is shown."""
    task = trial.task
    if not isinstance(task, TwoInterval):
        return None
    levels = {**stimulus, trial.stimulus.factor: task.standard}
    if trial.stimulus.second and task.standard_second is not None:
        levels[trial.stimulus.second.factor] = task.standard_second
    return levels
