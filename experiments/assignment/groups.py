"""Groups of participants: one for each combination of the levels of the factors between participants."""

from collections.abc import Iterable
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from experiments import design
from experiments.trials.declared import ClipSpec

if TYPE_CHECKING:
    from experiments.definition import Experiment


class Seat(NamedTuple):
    """Where a participant stands: the levels of their group, and their place in it, from 0."""

    levels: tuple[tuple[str, str], ...]
    number: int


def groups(experiment: "Experiment") -> list[tuple[tuple[str, str], ...]]:
    """The levels of each group, last factor fastest; one group without levels where no factor is between."""
    between = [factor for factor in experiment.factors if factor.between]
    return list(product(*([(factor.name, level.name) for level in factor.levels] for factor in between)))


def name_of(levels: Iterable[tuple[str, str]]) -> str:
    """A group as quotas, links and exports name it; empty where there is one group only."""
    return "/".join(level for _, level in levels)


def names(experiment: "Experiment") -> list[str]:
    """The groups by name, in the order of their turns."""
    return [name_of(levels) for levels in groups(experiment)]


def seat_of(experiment: "Experiment", slot: int) -> Seat:
    """The place of a slot of the study: groups take turns, so that their sizes differ by at most one."""
    every = groups(experiment)
    return Seat(every[slot % len(every)], slot // len(every))


def of_group(experiment: "Experiment", levels: Iterable[tuple[str, str]]) -> "Experiment":
    """The experiment as one group sees it: factors between participants have the group's level alone."""
    mine = dict(levels)
    if not mine:
        return experiment
    factors = []
    for factor in experiment.factors:
        kept = tuple(level for level in factor.levels if mine.get(factor.name, level.name) == level.name)
        factors.append(factor.model_copy(update={"levels": kept}))
    return experiment.model_copy(update={"factors": tuple(factors)})


def cells_of(experiment: "Experiment", seat: Seat) -> list[tuple[tuple[str, str], ...]]:
    """The cells that the group sees, in the order of the design."""
    return [cell for cell in design.cells(experiment) if set(seat.levels) <= set(cell)]


def clips_of(experiment: "Experiment", seat: Seat) -> list[ClipSpec]:
    """The clips of those cells, in the order of the design."""
    return [clip for clip in design.clips(experiment) if set(seat.levels) <= set(clip.levels)]
