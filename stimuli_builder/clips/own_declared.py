"""Whether somebody's own clips are those that a declaration wants: its factors, their levels, every cell."""

from collections.abc import Sequence

from experiments import design
from experiments.definition import Experiment
from experiments.errors import InputError, and_others, did_you_mean, nearest
from experiments.own_clips import Placed


def check_against_declaration(placed: Placed, experiment: Experiment) -> None:
    """InputError unless clips have the factors, levels and cells that are declared, and no others.

    Factors before levels, and levels before cells: a misspelt name is told, not the cells that it empties.
    """
    for check in (_factors, _levels):
        if problems := check(placed, experiment):
            raise InputError(f"{problems[0]}{and_others(len(problems) - 1)}")
    _check_cells(placed, experiment)


def _factors(placed: Placed, experiment: Experiment) -> list[str]:
    present, declared = next(iter(placed.values()), ({}, 0))[0], experiment.factor_names
    without = [name for name in declared if name not in present]
    undeclared = [
        f"factor '{name}' of the clips is not declared in {experiment.name}"
        + (did_you_mean(name, without) or f", which has {', '.join(declared)}; declare it, or leave it out")
        for name in present
        if name not in declared
    ]
    return undeclared or [
        f"the clips have no levels of '{name}', a factor of {experiment.name}; add it to pattern or table"
        for name in without
    ]


def _levels(placed: Placed, experiment: Experiment) -> list[str]:
    """Levels that are not declared; else those that no clip has, since a slip makes one of each."""
    undeclared, unused = [], []
    for factor in experiment.factors:
        declared = [level.name for level in factor.levels]
        files = {levels[factor.name]: file for file, (levels, _) in reversed(placed.items())}
        without = [level for level in declared if level not in files]
        for level in sorted(files.keys() - set(declared)):
            near = nearest(level, declared)
            hint = f"; did you mean '{near}', which no clip has?" if near in without else ""
            hint = hint or did_you_mean(level, declared)
            undeclared.append(f"level '{level}' of {factor.name} ({files[level]}) is not declared{hint}")
        unused += [
            f"no clip has the level '{level}' of {factor.name}, which is declared" for level in without
        ]
    return undeclared or [f"{problem}; add its clips or take it out" for problem in unused]


def _check_cells(placed: Placed, experiment: Experiment) -> None:
    declared = {(spec.cell, spec.exemplar) for spec in design.clips(experiment)}
    factors = experiment.factor_names
    present = {(cell_of(levels, factors), exemplar) for levels, exemplar in placed.values()}
    for word, cells in (("is missing", declared - present), ("is not declared", present - declared)):
        if cells:
            cell, exemplar = min(cells)
            raise InputError(
                f"{len(declared)} clips are declared, {len(present)} are here: {cell}, exemplar {exemplar}, "
                f"{word}; correct the names or the declaration"
            )


def cell_of(levels: dict[str, str], factors: Sequence[str]) -> str:
    """The cell of these levels, by its name: a level each factor, in order."""
    return "/".join(levels[factor] for factor in factors)
