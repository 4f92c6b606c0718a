"""Read paired comparisons: who won, by side, with every doubt about the table raised as one line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.exported_rows import EXPORT_COLUMNS, rows_that_count
from analysis.read.number_columns import MISSING_MARKS
from analysis.read.text_table import (
    TextTable,
    name_lines,
    names_in_order,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from experiments.errors import InputError

LEFT, RIGHT, TIE = 0, 1, 2
EXPORTED_SIDES = {"kind", "left_cell", "right_cell"}
"""Columns by which the server's export is known."""
Codes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Comparisons of items.

    Attributes
    ----------
    items : tuple of str
        Names: sorted as text, or in declared order.
    left, right : (n,) int64
        Index into `items` of what stood on each side (or came first and second).
    outcome : (n,) int64
        `LEFT`, `RIGHT` or `TIE`.
    participant : (n,) int64 or None
        Index into `participants`.
    """

    items: tuple[str, ...]
    left: Codes
    right: Codes
    outcome: Codes
    participant: Codes | None
    participants: tuple[str, ...]
    source: str
    synthetic: bool
    decisions: tuple[str, ...]

    @property
    def ties(self) -> int:
        """How many comparisons ended in a tie."""
        return int(np.sum(self.outcome == TIE))


def read_comparisons(
    path: Path, left: str, right: str, winner: str, tie: str | None = None, participant: str | None = None
) -> Comparisons:
    """Read one row a comparison.

    Of the server's export only main trials count, without failed plays and runs excluded by hand.

    Parameters
    ----------
    path : Path
        CSV; ids are text, leading zeros stay.
    left, right, winner : str
        Columns. A cell of `winner` is `left`, `right`, the name of one of the row's two items, or `tie`.
    tie : str, optional
        What stands in `winner` for a tie.
    participant : str, optional
        Column that names the rater.

    Raises
    ------
    InputError
        As `read_text_table`; a pair of an item with itself; a winner that is none of the two; a `tie` that
        is an item or a side.
    """
    roles = [left, right, winner, *([participant] if participant else [])]
    refuse_shared_roles(roles)
    table = read_text_table(path, roles, EXPORT_COLUMNS)
    for name in (left, right, *([participant] if participant else [])):
        texts_required(table, name)
    columns = {name: table.columns[name].astype(str).to_numpy() for name in roles}
    _refuse_same(table, columns[left], columns[right])
    outcome, judged = _outcomes(table, columns[left], columns[right], columns[winner], winner, tie)
    if set(table.header) >= EXPORTED_SIDES:
        judged, left_out = rows_that_count(table.columns, judged)
        table.decisions.extend(left_out)
        if not judged.any():
            raise InputError(f"{path.name}: no comparison counts; {', '.join(left_out)}")
    items = _items(table.columns[left], table.columns[right], judged)
    people: tuple[str, ...] = ()
    codes = None
    if participant is not None:
        names, codes = np.unique(columns[participant][judged], return_inverse=True)
        people = tuple(str(name) for name in names)
    return Comparisons(
        items,
        _indices(items, columns[left][judged]),
        _indices(items, columns[right][judged]),
        outcome[judged],
        None if codes is None else codes.astype(np.int64),
        people,
        path.name,
        table.synthetic,
        tuple(table.decisions),
    )


def _items(left: "pd.Series[Any]", right: "pd.Series[Any]", judged: NDArray[np.bool_]) -> tuple[str, ...]:
    """Items of either side: in the order of their codes where both sides have codes, else sorted."""
    names = (*names_in_order(left, judged), *names_in_order(right, judged))
    coded = left.cat.ordered and right.cat.ordered
    return tuple(dict.fromkeys(names)) if coded else tuple(sorted(set(names)))


def _indices(items: tuple[str, ...], names: NDArray[Any]) -> Codes:
    position = {item: index for index, item in enumerate(items)}
    return np.array([position[name] for name in names], dtype=np.int64)


def _refuse_same(table: TextTable, left: NDArray[Any], right: NDArray[Any]) -> None:
    same = left == right
    if same.any():
        row = int(np.argmax(same))
        raise InputError(f"{table.source}: line {table.line(row)} compares '{left[row]}' with itself")


def _outcomes(
    table: TextTable,
    left: NDArray[Any],
    right: NDArray[Any],
    said: NDArray[Any],
    winner: str,
    tie: str | None,
) -> tuple[Codes, NDArray[np.bool_]]:
    """Return the outcome of each row, and which rows have one."""
    sides = {"left": LEFT, "right": RIGHT}
    confused = sides.keys() & {name.casefold() for name in (*left, *right)}
    if confused:
        name = min(confused)
        raise InputError(f"{table.source}: an item is called '{name}', as is a side; rename the item")
    if tie is not None:
        _refuse_tie(table, tie, {*left, *right})
    outcome = np.full(left.size, -1, dtype=np.int64)
    folded = np.char.lower(said.astype(str))
    for name, code in sides.items():
        outcome[folded == name] = code
    if tie is not None:
        outcome[said == tie] = TIE
    outcome[said == left] = LEFT
    outcome[said == right] = RIGHT
    missing = np.isin(said, [mark for mark in MISSING_MARKS if mark != tie]) & (outcome < 0)
    _refuse_unknown(table, outcome, missing, said, winner)
    if missing.any():
        lines = name_lines(table, missing)
        table.decisions.append(f"{int(missing.sum())} rows without a winner left out ({lines})")
    if missing.all():
        raise InputError(f"{table.source}: '{winner}' names a winner in no row")
    return outcome, ~missing


def _refuse_tie(table: TextTable, tie: str, items: set[str]) -> None:
    """Refuse a word for ties that names a winner as well."""
    other = "an item" if tie in items else "a side" if tie.casefold() in ("left", "right") else ""
    if other:
        raise InputError(
            f"{table.source}: --tie {tie} is {other} too; expected a word for ties that names no winner: "
            "write another in the rows that are ties"
        )


def _refuse_unknown(
    table: TextTable, outcome: Codes, missing: NDArray[np.bool_], said: NDArray[Any], winner: str
) -> None:
    unknown = (outcome < 0) & ~missing
    if unknown.any():
        row = int(np.argmax(unknown))
        raise InputError(
            f"{table.source}: '{winner}' is '{said[row]}' in line {table.line(row)}; expected left, right or "
            f"one of the row's two items (where it means a tie: --tie {said[row]})"
        )
