"""The kinds of trial, and the registry that finds them by name.

A new kind needs a file with its name in `experiments.declaration`, for its [trial], and one here, with its
`Kind`. Both are found by name.
"""

from importlib import import_module
from typing import Annotated, NamedTuple

from experiments import design
from experiments.columns.view import View
from experiments.declaration.any_trial import TRIALS, CheckAnswer
from experiments.declaration.base import Declaration
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import Answer, ByKind, RatedScale
from experiments.errors import InputError, did_you_mean
from experiments.kinds.kind import Kind

# The kinds of trial, and the registry that finds them by name.


def _kind_in(name: str) -> Kind:
    """The kind of a file of this folder."""
    module = import_module(f"experiments.kinds.{name}")
    for value in vars(module).values():
        if isinstance(value, Kind) and value.name == name:
            return value
    raise TypeError(f"{module.__name__}: expected a Kind called '{name}', found none")


KINDS: dict[str, Kind] = {name: _kind_in(name) for name in TRIALS}
"""Every kind by name in the TOML; the first is the default."""


def views() -> tuple[View, ...]:
    """The SQL views of all kinds, which every upgrade recreates (`server.core.database_views`)."""
    return tuple(kind.view for kind in KINDS.values())


def reserved_names() -> frozenset[str]:
    """Names that no factor may have, because other columns of the export have them."""
    return frozenset(name for view in views() for name in view.names)


# Types whose kind is named by their key `kind`: what a page gets, an answer.

AnyPage = Annotated[Declaration, ByKind(lambda: {name: kind.page for name, kind in KINDS.items()})]
AnyAnswer = Annotated[
    Answer, ByKind(lambda: {**{name: kind.answer for name, kind in KINDS.items()}, "check": CheckAnswer})
]


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
