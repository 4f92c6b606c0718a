"""Long rows as what the mixed and ordinal models need: codes, sum-coded cells, crossed groups."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.within.cell_means import natural_order
from analysis.within.contrasts import effect_members, effect_name, orthonormal_basis
from experiments.errors import InputError, did_you_mean

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Slopes = Literal["none", "main", "all", "correlated"]


@dataclass(frozen=True)
class ModelData:
    """Trials of participants crossed with items, in coded form.

    `cell`, `participant`, `item` are codes (n,), `rating` the responses (n,). `fixed` (cells, cells) is the
    sum-coded full factorial, `spread` (cells, cells) the same effects as orthonormal contrasts scaled to unit
    variance; `effect_of` names the effect of each column, `intercept` first.
    """

    factors: tuple[str, ...]
    levels: tuple[tuple[str, ...], ...]
    participants: tuple[str, ...]
    items: tuple[str, ...]
    cell: Integers = field(repr=False)
    participant: Integers = field(repr=False)
    item: Integers = field(repr=False)
    rating: Floats = field(repr=False)
    fixed: Floats = field(repr=False)
    spread: Floats = field(repr=False)
    effect_of: tuple[str, ...]
    column_names: tuple[str, ...]

    @property
    def effects(self) -> list[str]:
        """Effects in order, main effects first, without the intercept."""
        return list(dict.fromkeys(name for name in self.effect_of if name != "intercept"))

    def columns(self, effect: str) -> Integers:
        """Positions of an effect's columns."""
        return np.flatnonzero(np.array(self.effect_of) == effect)

    def differences(self, effect: str) -> Floats:
        """Contrasts (q, fixed columns) of an effect as differences from the first level of each factor.

        The df of a test of several contrasts depend a little on how these are written; lmerTest's are these.
        """
        members = effect.split(":")
        rows: Floats = np.ones((1, 1))
        for factor, names in zip(self.factors, self.levels, strict=True):
            size = len(names)
            from_first = np.hstack([-np.ones((size - 1, 1)), np.eye(size - 1)])
            rows = np.asarray(
                np.kron(rows, from_first if factor in members else np.full((1, size), 1 / size))
            )
        return np.asarray(rows @ self.fixed, dtype=np.float64)


def model_data(
    rows: pd.DataFrame,
    participant: str,
    item: str | Sequence[str] | None,
    rating: str,
    within: Sequence[str],
) -> ModelData:
    """Code long rows, one a trial.

    `item` is the column that names what was rated (a clip, a blink); several columns together name it
    where one is not unique (exemplars numbered afresh within a profile); without it there is one code and
    no item. Raises InputError for unknown
    columns, missing values, fewer than two participants, items or levels, and for cells that nobody rated.
    """
    item_columns = [item] if isinstance(item, str) else list(item or ())
    for name in (participant, rating, *within, *item_columns):
        if name not in rows.columns:
            raise InputError(f"no column is called '{name}'{did_you_mean(name, map(str, rows.columns))}")
    if rows.empty:
        raise InputError("there are no ratings to analyse; the table has a header but no rows")
    values = pd.to_numeric(rows[rating], errors="coerce").to_numpy(dtype=np.float64)
    if not np.isfinite(values).all():
        bad = rows[rating].iloc[int(np.flatnonzero(~np.isfinite(values))[0])]
        raise InputError(f"expected numbers in '{rating}', got {bad!r}; correct or remove the row")
    if np.ptp(values) == 0:
        raise InputError(f"every rating is {values[0]:g}; a model needs ratings that vary")
    who, people = _coded(rows[participant], "participants")
    what, items = _coded_items(rows, item_columns)
    coded = [_coded(rows[name], f"levels of '{name}'") for name in within]
    levels = tuple(names for _, names in coded)
    shape = tuple(len(names) for names in levels)
    cell = np.ravel_multi_index(tuple(codes for codes, _ in coded), shape).astype(np.int64)
    _refuse_empty_cells(cell, within, levels)
    fixed, spread, effect_of, names = _design(list(within), levels)
    return ModelData(
        tuple(within), levels, people, items, cell, who, what, values, fixed, spread, effect_of, names
    )


def slope_groups(data: ModelData, slopes: Slopes) -> tuple[list[str], list[str]]:
    """Effects with a by-participant slope (`intercept` first), and what had to be left out."""
    if slopes == "none":
        return ["intercept"], []
    if slopes != "all":
        return ["intercept", *data.factors], []
    cells = len(data.fixed)
    counts = np.bincount(data.participant * cells + data.cell, minlength=len(data.participants) * cells)
    if counts.max() > 1:
        return ["intercept", *data.effects], []
    left_out = data.effects[-1]
    kept = [effect for effect in data.effects if effect != left_out]
    return ["intercept", *kept], [f"no slope of {left_out}: with one rating a cell it is the residual"]


def _coded(column: "pd.Series[str]", what: str) -> tuple[Integers, tuple[str, ...]]:
    texts = column.astype(str)
    names = natural_order(sorted(set(texts)))
    if len(names) < 2:
        raise InputError(f"expected at least two {what}, got {len(names)}")
    position = {name: i for i, name in enumerate(names)}
    return np.asarray(texts.map(position), dtype=np.int64), tuple(names)


def _coded_items(rows: pd.DataFrame, columns: list[str]) -> tuple[Integers, tuple[str, ...]]:
    if not columns:
        return np.zeros(len(rows), np.int64), ()
    label = rows[columns[0]].astype(str)
    for extra in columns[1:]:
        label = label + "/" + rows[extra].astype(str)
    return _coded(label, "items")


def _refuse_empty_cells(cell: Integers, within: Sequence[str], levels: Sequence[Sequence[str]]) -> None:
    counts = np.bincount(cell, minlength=int(np.prod([len(names) for names in levels])))
    if (counts == 0).any():
        names = list(product(*levels))[int(np.flatnonzero(counts == 0)[0])]
        where = ", ".join(f"{factor}={level}" for factor, level in zip(within, names, strict=True))
        raise InputError(f"nobody rated the cell {where}; leave out a factor or level")


def _sum_coding(levels: int) -> Floats:
    """Contrasts of R's contr.sum with a column of ones before them, (levels, levels)."""
    coding = np.eye(levels)[:, :-1]
    coding[-1] = -1.0
    return np.hstack([np.ones((levels, 1)), coding])


def _design(
    factors: list[str], levels: Sequence[Sequence[str]]
) -> tuple[Floats, Floats, tuple[str, ...], tuple[str, ...]]:
    sizes = [len(names) for names in levels]
    fixed, spread = [np.ones((int(np.prod(sizes)), 1))], [np.ones((int(np.prod(sizes)), 1))]
    effect_of, names = ["intercept"], ["intercept"]
    for members in effect_members(len(factors)):
        codings: Floats = np.ones((1, 1))
        bases: Floats = np.ones((1, 1))
        for axis, size in enumerate(sizes):
            inside = axis in members
            codings = np.asarray(np.kron(codings, _sum_coding(size)[:, 1:] if inside else np.ones((size, 1))))
            basis = orthonormal_basis(size) * np.sqrt(size)
            bases = np.asarray(np.kron(bases, basis[:, 1:] if inside else np.ones((size, 1))))
        fixed.append(codings)
        spread.append(bases)
        effect = effect_name([factors[m] for m in members])
        effect_of += [effect] * codings.shape[1]
        inner = product(*[levels[m][:-1] for m in members])
        names += [
            ":".join(f"{factors[m]}[{lv}]" for m, lv in zip(members, row, strict=True)) for row in inner
        ]
    return np.hstack(fixed), np.hstack(spread), tuple(effect_of), tuple(names)
