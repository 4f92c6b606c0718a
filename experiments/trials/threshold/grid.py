"""The rendered grid as series see it: stimuli with their numbers, and what QUEST+ is told of a function."""

from itertools import product
from typing import TYPE_CHECKING, Literal, NamedTuple

from experiments.design import ClipSpec
from experiments.trials.threshold.declaration import Range, Series, Threshold, TwoInterval, threshold_of
from experiments.trials.threshold.faults import number_of, tested

if TYPE_CHECKING:
    from experiments.definition import Experiment


class Model(NamedTuple):
    """The psychometric function that a series assumes, and the parameters it considers.

    P(x) = guess + (1 - guess - lapse) F(x), F the normal distribution function of mean `threshold` and SD
    `spread`, or the Weibull 1 - exp(-(x / threshold)^spread). Where it falls, x and threshold change sign.
    """

    function: Literal["normal", "weibull"]
    falling: bool
    stimuli: tuple[float, ...]
    thresholds: tuple[float, ...]
    spreads: tuple[float, ...]
    guess: float
    lapse: float


def stimuli(experiment: "Experiment") -> dict[float, str]:
    """Level of the stimulus factor by its number, ascending."""
    trial = threshold_of(experiment)
    levels = [level.name for level in experiment.factor(trial.stimulus.factor).levels]
    numbers = {number_of(trial.stimulus, level): level for level in tested(trial, levels)}
    return dict(sorted((number, level) for number, level in numbers.items() if number is not None))


def model(experiment: "Experiment") -> Model:
    """The declared function with its defaults filled in."""
    trial, numbers = threshold_of(experiment), tuple(stimuli(experiment))
    low, high = numbers[0], numbers[-1]
    weibull = trial.function == "weibull"
    usual = Range(lowest=1, highest=10, steps=10)
    if not weibull:
        usual = Range(lowest=(high - low) / 20, highest=(high - low) / 2, steps=10)
    return Model(
        trial.function,
        trial.direction == "falling",
        numbers,
        (trial.thresholds or Range(lowest=low, highest=high)).numbers,
        (trial.spreads or usual).numbers,
        trial.task.guess,
        trial.lapse,
    )


def series_of(experiment: "Experiment") -> tuple[Series, ...]:
    """The declared series; where none is, one a combination of the other factors' levels."""
    trial = threshold_of(experiment)
    if trial.series:
        return trial.series
    others = [factor for factor in experiment.factors if factor.name != trial.stimulus.factor]
    combinations = product(*([(factor.name, level.name) for level in factor.levels] for factor in others))
    return tuple(
        Series(name=f"s{number}", levels=dict(levels)) for number, levels in enumerate(combinations, start=1)
    )


def clip_of(experiment: "Experiment", levels: dict[str, str], stimulus: str, exemplar: int) -> ClipSpec:
    """The clip of the grid with this level of the stimulus factor."""
    every = {**levels, threshold_of(experiment).stimulus.factor: stimulus}
    return ClipSpec(tuple((name, every[name]) for name in experiment.factor_names), exemplar)


def exemplar_at(experiment: "Experiment", position: int) -> int:
    """Exemplar of the clips at a place (from 1) of a series: they go round, whatever the stimulus is."""
    return 1 + position % experiment.exemplars.per_cell


def standard_of(trial: Threshold) -> str | None:
    """The level shown for comparison; None where one clip is shown."""
    return trial.task.standard if isinstance(trial.task, TwoInterval) else None
