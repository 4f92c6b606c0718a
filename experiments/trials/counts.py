"""How many trials a participant has, and how long they take, whatever their kind."""

from typing import TYPE_CHECKING, NamedTuple

from experiments import design
from experiments.trials import KINDS

if TYPE_CHECKING:
    from experiments.definition import Experiment


class BlockSize(NamedTuple):
    """A block as declared: its label, and how many trials a participant has in it."""

    label: str
    trials: int


def trials_per_participant(experiment: "Experiment") -> int:
    """Rated trials of one participant, practice and attention checks not counted."""
    return sum(block.trials for block in block_sizes(experiment))


def block_sizes(experiment: "Experiment") -> list[BlockSize]:
    """The blocks in declared order, repeats included."""
    size = KINDS[experiment.trial.kind].block_size
    return [BlockSize(block.label, size(experiment, block)) for block in design.blocks(experiment)]


def expected_minutes(experiment: "Experiment") -> float:
    """Expected length of a visit in minutes: trials times the declared seconds a trial."""
    trials = trials_per_participant(experiment) + experiment.practice.trials
    return round(trials * experiment.trial.expected_seconds / 60, 1)
