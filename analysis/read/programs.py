"""Exports of programs for experiments: recognized by their columns, without rows that are not trials.

jsPsych, PsychoPy and Gorilla write a row for everything that happened: a fixation cross, an instruction, the
end of a task. A row that lacks one of the columns asked for is such a row; how many and of what sort is said.
"""

import json
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from table_files.cells import Cells

EMPTY = frozenset({"", "null", "None", "undefined", '""', "NaN"})


@dataclass(frozen=True)
class Program:
    """A program, the columns only it writes, and the column that says what sort a row is."""

    name: str
    columns: frozenset[str]
    sort: str | None


PROGRAMS = (
    Program("jsPsych", frozenset({"trial_type", "trial_index", "time_elapsed"}), "trial_type"),
    Program("PsychoPy", frozenset({"psychopyVersion"}), None),
    Program("PsychoPy", frozenset({"expName", "frameRate"}), None),
    Program("Gorilla", frozenset({"Event Index", "Participant Private ID"}), "Zone Type"),
)


def program_of(header: tuple[str, ...] | list[str]) -> Program | None:
    """The program whose columns the header holds; None for any other table."""
    return next((program for program in PROGRAMS if program.columns <= set(header)), None)


def trials_only(cells: Cells, asked: list[str], sorts: Cells | None) -> Cells:
    """The rows in which every column `asked` holds something; `sorts` has the program's own column."""
    program = program_of(cells.header)
    if program is None or not asked:
        return cells
    keep = ~cells.rows[asked].isin(EMPTY).any(axis=1).to_numpy()
    said = f"read as data of {program.name}"
    if not keep.all():
        said += f": {(~keep).sum()} rows without {' and '.join(repr(name) for name in asked)} excluded"
        if sorts is not None:
            counts = sorts.rows.iloc[np.flatnonzero(~keep), 0].replace("", "no sort").value_counts()
            said += f" ({', '.join(f'{sort} {count}' for sort, count in counts.items())})"
    kept = cells.of_rows(keep)
    surveys = [answer for name in asked if (answer := _one_answer(kept.rows, name))]
    return replace(kept, decisions=(*cells.decisions, said, *surveys))


def _one_answer(rows: pd.DataFrame, name: str) -> str:
    """Put the number in the place of jsPsych's `{"Q0": 5}` in a column of `rows`, and say so; else nothing.

    A survey of several questions has several members: it stays as it is, since none of them is the answer.
    """
    texts = [str(text) for text in rows[name].unique() if str(text).lstrip().startswith("{")]
    numbers = {text: number for text in texts if (number := _only_number(text)) is not None}
    if not texts or len(numbers) < len(texts):
        return ""
    rows[name] = rows[name].astype(str).replace(numbers)
    shown = f"{texts[0]} read as {numbers[texts[0]]}"
    return f"'{name}' has surveys of one question: {shown}; jsPsych numbers their choices from 0"


def _only_number(text: str) -> str | None:
    """The number of a JSON object with one member, as text; None for anything else."""
    try:
        answer = json.loads(text)
    except ValueError:
        return None
    values = list(answer.values()) if isinstance(answer, dict) else []
    numeric = len(values) == 1 and isinstance(values[0], int | float) and not isinstance(values[0], bool)
    return repr(values[0]) if numeric else None
