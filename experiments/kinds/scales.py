"""The scales of a study, how many trials a participant has, and how long they take."""

from typing import NamedTuple

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import RatedScale
from experiments.errors import InputError, did_you_mean
from experiments.kinds import KINDS

# The scales that a trial of any kind asks for, as Results, reports and the analysis read them.


def scales_of(experiment: Experiment) -> tuple[RatedScale, ...]:
    """The scales of the experiment's trials in order; empty for kinds without scales."""
    return experiment.trial.rated_scales()


def scale_called(experiment: Experiment, name: str | None = None) -> RatedScale:
    """The scale with this name, or the first if no name is given; InputError if there is none."""
    scales = scales_of(experiment)
    if not scales:
        raise InputError(
            f"expected trials with a scale, got trials of the kind {experiment.trial.kind} in "
            f"'{experiment.name}'"
        )
    names = [scale.name for scale in scales]
    if name is not None and name not in names:
        raise InputError(f"'{experiment.name}' has no scale '{name}'{did_you_mean(name, names)}")
    return scales[names.index(name) if name is not None else 0]


# How many trials a participant has, and how long they take, for any kind.


class BlockSize(NamedTuple):
    """A block as declared: its label, and how many trials a participant has in it."""

    label: str
    trials: int


def trials_per_participant(experiment: Experiment) -> int:
    """Rated trials of one participant, without practice and attention checks."""
    return sum(block.trials for block in block_sizes(experiment))


def block_sizes(experiment: Experiment) -> list[BlockSize]:
    """The blocks in declared order, repeats included."""
    size = KINDS[experiment.trial.kind].block_size
    return [BlockSize(block.label, size(experiment, block)) for block in design.blocks(experiment)]


def expected_minutes(experiment: Experiment) -> float:
    """Expected length of a visit in minutes: number of trials times the declared seconds per trial."""
    trials = trials_per_participant(experiment) + experiment.practice.trials
    return round(trials * experiment.trial.expected_seconds / 60, 1)
