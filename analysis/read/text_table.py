"""Read a long table as text, with every doubt about it raised as one line."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.folder import reader_of
from analysis.read.wide import refuse_names_twice, said_of_copies, wide_hint
from analysis.within.level_codes import natural_order
from experiments.errors import InputError, nearest
from table_files import counted
from table_files.cells import Cells
from table_files.open import Reader

# Exports of programs for experiments: recognized by their columns, without rows that are not trials.
#
# jsPsych, PsychoPy and Gorilla write a row for everything that happened: a fixation cross, an instruction,
# the end of a task. A row that lacks one of the required columns is such a row.

EMPTY = frozenset({"", "null", "None", "undefined", '""', "NaN"})


YES = frozenset({"1", "1.0", "true", "yes"})
"""What a flag says, in lower case; pandas writes 1 as 1.0 where a cell of the column is empty."""
NO = frozenset({"0", "0.0", "false", "no", "na", "nan", ""})


def flags(column: "pd.Series[Any]", source: str) -> NDArray[np.bool_]:
    """A column of flags as truth values; an empty cell is none.

    Raises
    ------
    InputError
        A word that says neither: whether an answer counts must not be guessed.
    """
    words = column.astype(str).str.casefold()
    if (other := ~words.isin(YES | NO)).any():
        raise InputError(f"{source}: '{column.name}' is '{column[other].iloc[0]}' in a row; expected 0 or 1")
    return words.isin(YES).to_numpy()


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
        left_out = counted(int((~keep).sum()), "row")
        said += f": {left_out} without {' and '.join(repr(name) for name in asked)} excluded"
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


# The table: columns of text, and what was decided while they were read.

NAMED_ROWS = 5
NAMED_COLUMNS = 30


@dataclass
class TextTable:
    """Columns of text (categorical, kept as written, stripped) and what was decided while reading.

    `lines` (rows,) are the rows' lines in the file; `labels` has, of a column, the word for each code;
    `numeric` are columns of numbers, not of texts like them; `reader` reads further columns of the file;
    `files` (rows,) are the names of the files of a folder.
    """

    columns: pd.DataFrame
    source: str
    header: tuple[str, ...]
    lines: NDArray[np.int64] = field(repr=False)
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    numeric: frozenset[str] = frozenset()
    decisions: list[str] = field(default_factory=list)
    reader: Reader | None = field(default=None, repr=False)
    files: NDArray[np.str_] | None = field(default=None, repr=False)

    @property
    def synthetic(self) -> bool:
        """Whether a column `synthetic`, where it was read, marks a row as made and not given by a person."""
        # pandas and R write a column of 0 and 1 that has passed through a condition as words.
        marks = self.columns.get("synthetic")
        return marks is not None and bool(marks.astype(str).str.lower().isin(YES).any())

    def read_again(self, names: Sequence[str]) -> pd.DataFrame:
        """Columns of the file as they are there, of the rows that are in this table."""
        if self.reader is None:
            return pd.DataFrame(index=self.columns.index)
        cells = self.reader.cells(list(names))
        keys = pd.Index(_row_keys(cells.lines, cells.files))
        return cells.rows.iloc[keys.get_indexer(pd.Index(_row_keys(self.lines, self.files)))]

    def line(self, row: int) -> str:
        """Line of the file on which data row `row` (from 0) begins: `7`, in a folder `7 of p1.csv`."""
        return str(self.lines[row]) if self.files is None else f"{self.lines[row]} of {self.files[row]}"


def read_text_table(
    path: Path, needed: Sequence[str] | None, optional: Sequence[str] = (), copies: bool = True
) -> TextTable:
    """Read the `needed` columns (all must exist; None: every one) and those of `optional` there, as text.

    The file may be CSV (comma, semicolon or tab, taken from the header line), an Excel workbook
    (`book.xlsx#Sheet` names a sheet), SPSS, a JSON list of trials, or a Psych-DS folder. Of data of jsPsych,
    PsychoPy and Gorilla only rows count that hold every column wanted. Ids keep their leading zeros, and
    names like `None` or `NA` stay names. A block of rows that is in the file twice is named (`copies`).

    Raises
    ------
    InputError
        No file, no text, no rows, rows of unequal length, a column missing or there twice.
    """
    reader = reader_of(path)
    header = reader.header()
    names = _names_to_read(_source(path), header, header if needed is None else needed, optional)
    cells = trials_only(reader.cells(names), list(needed or ()), _sorts(reader, header))
    if cells.rows.empty:
        raise InputError(f"{path.name} has a header but no rows{' that are trials' * bool(cells.decisions)}")
    table = TextTable(
        cells.rows,
        path.name,
        cells.header,
        cells.lines,
        cells.labels,
        cells.numeric,
        list(cells.decisions),
        reader,
        cells.files,
    )
    for name in names:
        table.columns[name] = _stripped(table.columns[name])
    _leave_out_empty_rows(table, names)
    if copies and (said := _copies(table, names)):
        table.decisions.append(said)
    return table


def _copies(table: TextTable, names: Sequence[str]) -> str:
    """What is said of rows that are copies in every column of the file; those read are compared first."""
    # Only where the columns that were read look copied, the whole file is read to compare all.
    if not said_of_copies(table.columns[list(names)], _Places(table)):
        return ""
    every = list(dict.fromkeys(name for name in table.header if name))
    return said_of_copies(table.read_again(every), _Places(table))


def _row_keys(lines: NDArray[np.int64], files: NDArray[np.str_] | None) -> list[tuple[str, int]]:
    names = [""] * len(lines) if files is None else [str(name) for name in files]
    return list(zip(names, (int(line) for line in lines), strict=True))


class _Places(Sequence[str]):
    """Lines of a table's rows, written when they are asked for."""

    def __init__(self, table: TextTable) -> None:
        self._table = table

    def __len__(self) -> int:
        return len(self._table.lines)

    def __getitem__(self, row: Any) -> Any:
        return self._table.line(int(row))


def _source(path: Path) -> str:
    """How an error names what was read: of a folder's columns only those count that all its files have."""
    name = path.resolve().name
    return f"the folder {name} (all its .csv files as one table)" if path.is_dir() else path.name


def _leave_out_empty_rows(table: TextTable, names: Sequence[str]) -> None:
    """Leave out rows like `,,,`, which spreadsheets write below a table."""
    empty = np.logical_and.reduce([(table.columns[name] == "").to_numpy() for name in names])
    if empty.all():
        raise InputError(f"{table.source} has a header but no rows")
    if empty.any():
        table.decisions.append(
            f"rows without a value in any column that is used were excluded ({name_lines(table, empty)})"
        )
        left = table.columns[~empty].reset_index(drop=True)
        # Else the empty text would stay a category, and count as a level.
        table.columns = left.apply(lambda column: column.cat.remove_unused_categories())
        table.lines = table.lines[~empty]
        table.files = None if table.files is None else table.files[~empty]


def _names_to_read(
    source: str, header: Sequence[str], needed: Sequence[str], optional: Sequence[str]
) -> list[str]:
    for name in needed:
        if name not in header:
            # columns that are requested are not cells of a wide table
            hint = (
                wide_hint([one for one in header if one not in needed])
                or _lines_above(header)
                or _columns_there(name, header)
            )
            raise InputError(f"{source} has no column '{name}'{hint}")
    there, asked = frozenset(header), {*needed, *optional}
    refuse_names_twice([name for name in header if name in asked], source)
    return list(dict.fromkeys([*needed, *(name for name in optional if name in there)]))


def _columns_there(name: str, header: Sequence[str]) -> str:
    near = nearest(name, header)
    if near:
        return f"; did you mean '{near}'?"
    rest = len(header) - NAMED_COLUMNS
    named = f"{', '.join(header[:NAMED_COLUMNS])}{f' and {rest} more' if rest > 0 else ''}"
    return f"; its columns are {named} (`analysis columns FILE` says which command and options fit)"


def _lines_above(header: Sequence[str]) -> str:
    """What to do about a first line that is not a header: a title, a comment, an unknown separator."""
    if len([name for name in header if name]) > 1:
        return ""
    return (
        f": its first line is {max(header, key=len)!r}; it should have the column names, separated by "
        "commas, semicolons or tabs; delete lines above it, and replace other separators"
    )


def _sorts(reader: Reader, header: Sequence[str]) -> Cells | None:
    """The column in which a known program says what sort a row is."""
    program = program_of(list(header))
    sort = program and program.sort
    return reader.cells([sort]) if sort and sort in header else None


def _stripped(column: "pd.Series[str]") -> "pd.Series[Any]":
    """The column as categories, without surrounding blanks."""
    codes, texts = pd.factorize(column)
    return pd.Series(categorical(codes, [str(text).strip() for text in texts]), index=column.index)


def categorical(codes: NDArray[np.integer[Any]], texts: Sequence[str]) -> "pd.Categorical[str]":
    """Categories, sorted, from codes into the names in `texts`; equal names become one."""
    names = sorted(set(texts))
    position = {name: i for i, name in enumerate(names)}
    lookup = np.array([position[name] for name in texts], dtype=np.int64)
    index: pd.Index[str] = pd.Index(names, dtype=object)
    return pd.Categorical.from_codes(lookup[codes], categories=index)


def refuse_shared_roles(names: Sequence[str]) -> None:
    """Refuse a column that is named for two roles."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"column '{name}' is named for two roles; each role needs a separate column")


def texts_required(
    table: TextTable, name: str, factor: bool = False, rows: NDArray[np.bool_] | None = None
) -> None:
    """Refuse empty cells in a column of names; codes of an SPSS file take the words the file has for them.

    The order of the levels of a `factor` is said where it is not that of their names. Where only `rows` (n,)
    are analyzed, the cells of the others may be empty.
    """
    table.columns[name] = _worded(table, table.columns[name], table.labels.get(name, {}), factor)
    column = table.columns[name]
    empty = (column == "").to_numpy()
    if (empty if rows is None else empty & rows).any():
        row = int(np.argmax(empty if rows is None else empty & rows))
        declared = ", or declared missing," if table.source.lower().endswith((".sav", ".zsav")) else ""
        raise InputError(
            f"{table.source}: '{name}' is empty{declared} in line {table.line(row)}; every row needs one"
        )
    folded: dict[str, str] = {}
    for text in column.cat.categories:
        other = folded.setdefault(text.casefold(), text)
        if other != text:
            table.decisions.append(
                f"'{other}' and '{text}' of '{name}' differ only in case; they are separate levels"
            )


def refuse_ids_once(rows: pd.DataFrame, name: str, header: Sequence[str], source: str) -> None:
    """Refuse a column of participants whose every value is in one row only, where some must come again.

    Parameters
    ----------
    rows : DataFrame
        The rows that were read.
    name : str
        The column of participants.
    header : sequence of str
        All columns of the file; they may look like the cells of a wide table.
    source : str
        How the error names the file.

    Raises
    ------
    InputError
        As said above, with the likely cause.
    """
    if len(rows) < 2 or rows[name].nunique() < len(rows):
        return
    hint = wide_hint([one for one in header if one and one != name])
    often = hint or (
        ". Is the table wide (one row per person; make it long with analysis reshape), or is this not the "
        "participant column?"
    )
    raise InputError(
        f"{source}: each value of '{name}' is in only one row, so nothing varies within participants{often}"
    )


def names_in_order(column: "pd.Series[Any]", rows: NDArray[np.bool_]) -> tuple[str, ...]:
    """The names in some rows of a column: in the order of their codes, where they have any, else sorted."""
    there = {str(name) for name in column[rows].unique()}
    names = column.cat.categories if column.cat.ordered else sorted(there)
    return tuple(str(name) for name in names if str(name) in there)


def _worded(
    table: TextTable, column: "pd.Series[Any]", words: Mapping[str, str], factor: bool
) -> "pd.Series[Any]":
    """The words of codes, as levels whose order is that of the codes."""
    if not words:
        return column
    codes = list(column.cat.categories)
    names = [words.get(code, code) for code in codes]
    twice = {name for name, times in Counter(names).items() if times > 1}
    if twice:
        table.decisions.append(
            f"several codes of '{column.name}' have the same label ({', '.join(sorted(twice))}); they are "
            "distinguished by their codes"
        )
        names = [
            f"{name} ({code})" if name in twice else name for name, code in zip(names, codes, strict=True)
        ]
    name_of = dict(zip(codes, names, strict=True))
    order = [name_of[code] for code in natural_order(codes)]
    if factor and order != natural_order(order):
        table.decisions.append(f"levels of '{column.name}' in the order of the codes: {', '.join(order)}")
    worded = pd.Categorical(np.array(names, dtype=object)[column.cat.codes], order, ordered=True)
    return pd.Series(worded, index=column.index)


def name_lines(table: TextTable, rows: NDArray[np.bool_]) -> str:
    """The lines of some rows in words, the first few only."""
    numbers = np.flatnonzero(rows)
    named = ", ".join(table.line(int(row)) for row in numbers[:NAMED_ROWS])
    rest = len(numbers) - NAMED_ROWS
    return f"line{'s' if len(numbers) > 1 else ''} {named}{f' and {rest} more' if rest > 0 else ''}"
