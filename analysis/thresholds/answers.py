"""Answers of a table: per trial a stimulus and yes or no, with participant and condition."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.read.number_columns import numbers
from analysis.read.reading import EXPORT_COLUMNS, answers_that_count, rows_with_names
from analysis.read.text_table import (
    TextTable,
    name_lines,
    names_in_order,
    read_text_table,
    refuse_shared_roles,
    texts_required,
)
from analysis.thresholds.likelihood import Trials
from analysis.within.level_codes import given_orders
from experiments.errors import InputError
from table_files import counted

Array = NDArray[np.float64]


# 1.0 comes from programs that write all numbers as decimals.
YES = frozenset({"1", "yes", "true", "correct", "seen", "y", "1.0"})


NO = frozenset({"0", "no", "false", "wrong", "incorrect", "unseen", "n", "0.0"})


@dataclass(frozen=True)
class Answers:
    """Rows of a table: stimulus x (n,), answer 0 or 1 (n,), and names of person and condition (n,).

    Attributes
    ----------
    second : float64 array or None
        A second stimulus variable (n,), where there is one.
    order : tuple of str
        Conditions in the order of their codes; empty where they have none, and are sorted.
    """

    x: Array
    response: Array
    participant: NDArray[np.object_] | None
    condition: NDArray[np.object_] | None
    source: str
    synthetic: bool
    decisions: tuple[str, ...]
    second: Array | None = None
    order: tuple[str, ...] = ()

    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions in order; one, `all`, where there are none."""
        if self.condition is None:
            return ("all",)
        return self.order or tuple(sorted({str(label) for label in self.condition}))


def read_answers(
    path: Path,
    x: str,
    response: str,
    participant: str | None = None,
    by: str | None = None,
    second: str | None = None,
    levels: Sequence[str] = (),
) -> Answers:
    """Read one row per trial: numbers `x` and `second`, and a `response` of 0/1, yes/no or correct/wrong.

    `levels` may give the order of the levels of `by` (`analysis.within.level_codes.given_orders`).

    Raises
    ------
    InputError
        As `read_text_table`; a response that is neither, a stimulus that is not a number.
    """
    named = [name for name in (participant, by) if name]
    roles = [x, response, *named, *([second] if second else [])]
    refuse_shared_roles(roles)
    # Columns of an export are read as well: they say which answers count.
    table = read_text_table(path, roles, EXPORT_COLUMNS)
    for name in named:
        texts_required(table, name, factor=name == by, rows=rows_with_names(table))
    values, answers = numbers(table, x), _binary(table, response)
    # A row without stimulus or answer cannot be fitted.
    keep = np.isfinite(values) & np.isfinite(answers)
    across = numbers(table, second) if second else None
    if across is not None:
        keep &= np.isfinite(across)
    if not keep.all():
        lines = name_lines(table, ~keep)
        table.decisions.append(
            f"{counted(int((~keep).sum()), 'row')} without stimulus or answer excluded ({lines})"
        )
    if not keep.any():
        raise InputError(f"{path.name}: no row has both '{x}' and '{response}'")
    # Last, so that its counts are of rows that would otherwise be used.
    keep = answers_that_count(table, keep, "answers", roles)
    names = [
        None if name is None else table.columns[name].astype(object).to_numpy()[keep]
        for name in (participant, by)
    ]
    # Only conditions of the remaining rows: one may have been in practice only.
    order = () if by is None else names_in_order(table.columns[by], keep)
    orders, said = given_orders({} if by is None else {by: order}, levels)
    return Answers(
        values[keep],
        answers[keep],
        names[0],
        names[1],
        path.name,
        table.synthetic,
        (*table.decisions, *said),
        None if across is None else across[keep],
        order if by is None else orders.get(by, order),
    )


def _binary(table: TextTable, response: str) -> Array:
    # Case is ignored: tables hold Yes, TRUE and correct in any form.
    texts = table.columns[response].astype(str).str.casefold().to_numpy()
    values = np.full(texts.size, np.nan)
    values[np.isin(texts, list(YES))], values[np.isin(texts, list(NO))] = 1.0, 0.0
    # Empty cells and marks of missing values are rows to leave out, not errors.
    unknown = np.isnan(values) & (texts != "") & (texts != "na") & (texts != "nan")
    if unknown.any():
        row = int(np.argmax(unknown))
        raise InputError(
            f"{table.source}: '{response}' is '{table.columns[response].iloc[row]}' in line "
            f"{table.line(row)}. Expected 1 or 0 (yes or no, correct or wrong), or an empty cell (or NA) if "
            "it is missing"
        )
    return values


def count_trials(x: Array, response: Array) -> Trials:
    """Count trials and positive answers at each level of x."""
    levels, index = np.unique(x, return_inverse=True)
    n, k = np.zeros(levels.size), np.zeros(levels.size)
    # Not `+=`, which would count a level that occurs several times only once.
    np.add.at(n, index, 1.0)
    np.add.at(k, index, response)
    return Trials(levels, n, k)
