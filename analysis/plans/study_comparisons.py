"""The comparisons of a study: its cells as items, and their levels in the compared factors."""

from collections import Counter
from collections.abc import Mapping

import numpy as np
import pandas as pd

from analysis.pairs.comparisons import LEFT, RIGHT, TIE, Comparisons
from analysis.pairs.factors import ItemFactors
from analysis.plans.prepared import Prepared
from experiments import design
from experiments.definition import Experiment
from experiments.errors import InputError

_OUTCOMES = {"left": LEFT, "right": RIGHT, "tie": TIE}


def looked_up(column: pd.Series, values: Mapping[str, float], otherwise: float) -> np.ndarray:
    """The value of each name of a categorical column."""
    of_category = np.array(
        [values.get(str(name), otherwise) for name in column.cat.categories] or [otherwise]
    )
    looked_up: np.ndarray = of_category[column.cat.codes.to_numpy()]
    return looked_up


def cells_of(experiment: Experiment) -> list[tuple[str, tuple[str, ...]]]:
    """Label and levels of every cell, in declared order."""
    levels = [tuple(level for _, level in cell) for cell in design.cells(experiment)]
    return [("/".join(names), names) for names in levels]


def comparisons_of(prepared: Prepared) -> Comparisons:
    """The comparisons as indices; two clips of one cell tell nothing of the cells and are left out."""
    rows, decisions = prepared.rows, list(prepared.decisions)
    same = (rows["left_cell"].astype(str) == rows["right_cell"].astype(str)).to_numpy()
    if same.any():
        decisions.append(f"{same.sum()} comparisons of two clips of one cell left out of the abilities")
        rows = rows[~same]
    if rows.empty:
        raise InputError(f"{prepared.source}: every comparison is of two clips of one cell; nothing to rank")
    decisions += _arrangements(rows)
    shown = {*rows["left_cell"].astype(str), *rows["right_cell"].astype(str)}
    items = tuple(name for name, _ in cells_of(prepared.experiment) if name in shown)
    position = {name: index for index, name in enumerate(items)}
    people, person = np.unique(rows["participant"].astype(str).to_numpy(), return_inverse=True)
    return Comparisons(
        items,
        looked_up(rows["left_cell"], position, -1).astype(np.int64),
        looked_up(rows["right_cell"], position, -1).astype(np.int64),
        looked_up(rows["winner"], _OUTCOMES, -1).astype(np.int64),
        person.astype(np.int64),
        tuple(str(name) for name in people),
        prepared.source,
        prepared.synthetic,
        tuple(decisions),
    )


def _arrangements(rows: pd.DataFrame) -> list[str]:
    """Where the two clips were not shown in one way throughout, how often in which."""
    if "arrangement" not in rows.columns:
        return []
    counts = Counter(name.replace("_", " ") for name in rows["arrangement"].astype(str) if name)
    named = [f"{number} {name}" for name, number in sorted(counts.items())]
    return (
        [f"comparisons were shown in {len(named)} arrangements: {', '.join(named)}"] if len(named) > 1 else []
    )


def factors_of(experiment: Experiment, items: tuple[str, ...]) -> ItemFactors | None:
    """The levels of the compared cells in the factors in which they differ; None where in none."""
    levels = {name: names for name, names in cells_of(experiment) if name in items}
    varied = [
        index
        for index in range(len(experiment.factors))
        if len({names[index] for names in levels.values()}) > 1
    ]
    if not varied:
        return None
    return ItemFactors(
        tuple(experiment.factors[index].name for index in varied),
        {name: tuple(names[index] for index in varied) for name, names in levels.items()},
        experiment.name,
        {
            experiment.factors[index].name: tuple(level.name for level in experiment.factors[index].levels)
            for index in varied
        },
    )
