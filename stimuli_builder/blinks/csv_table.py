"""A table with a header as columns of numbers and texts, whatever its sort of file and its decimal mark."""

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.errors import InputError
from table_files.delimited import delimited_table, encoding_of
from table_files.formulas import guarded_cell, guarded_row, unguarded_cell
from table_files.open import is_delimited, reader_of, refuse_unread

NOTE = "note"
"""Key of `DataFrame.attrs` under which a table says how it was read; absent where that is plain."""
MAX_NAMED = 6
FIRST_LINES = 40
"""Lines in which other programs' files are recognized."""
EYELINK = ("** converted from", "** date:", "** type: edf")
_SEPARATORS = {";": "semicolons", "\t": "tabs"}
_COMMA_OR_WHOLE = re.compile(r"[+-]?[0-9]*(,[0-9]+|(?<=[0-9]))([eE][+-]?[0-9]+)?")
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(,[0-9]{3})+")


def read_table(path: Path, *, alone: str = "", as_written: bool = False) -> pd.DataFrame:
    """Read a series, track, review, blink or table of profiles, column names stripped of blanks.

    Columns of which every cell is a number or empty are numbers. Decimal commas are read as points;
    `attrs[NOTE]` then says so, for the person to see, as it says what else is not plain.

    Parameters
    ----------
    path : Path
        CSV, Excel, SPSS or JSON.
    alone : str
        A column that may be the file's only one: its commas are decimal. A first line that is a number
        without a comma is its first value, if there is no header line.
    as_written : bool
        Cells are the text in the file, and blank lines below the header are rows: only a blank is missing.

    Returns
    -------
    DataFrame

    Raises
    ------
    InputError
        A folder, no text, or no table with rows.
    """
    header, rows, separator, said = _opened(path, alone, blank_lines=as_written)
    table = _typed(header, rows, as_written)
    if table.empty:
        raise InputError(f"{path.name}: the table has a header but no rows")
    if separator in _SEPARATORS and header != [alone]:
        said.append(f"columns separated by {_SEPARATORS[separator]}")
    if example := _read_decimal_commas(table, separator):
        said.append(f"decimal commas (e.g. '{example}') read as decimal points")
    if said:
        table.attrs[NOTE] = f"{path.name}: {', '.join(said)}"
    return table


def _opened(
    path: Path, alone: str, blank_lines: bool
) -> tuple[list[str], Iterator[Sequence[str]], str, list[str]]:
    """The names of the columns, the rows as text, the separator (none but in CSV) and what is to be said."""
    refuse_unread(path)
    if not is_delimited(path):
        reader = reader_of(path)
        header = reader.header()
        cells = reader.cells(header)
        return header, cells.rows.itertuples(index=False, name=None), "", list(cells.decisions)
    _refuse_other_formats(path)
    table = delimited_table(path, alone=alone)
    rows = (row for _, row in table.rows(blank_lines=blank_lines))
    return list(table.header), rows, table.separator, list(table.notes)


def _typed(header: Sequence[str], rows: Iterable[Sequence[str]], as_written: bool) -> pd.DataFrame:
    """The rows as a table; pandas decides which columns are numbers."""
    plain = io.StringIO()
    csv.writer(plain).writerows([header])
    csv.writer(plain).writerows(rows)
    plain.seek(0)
    options: dict[str, Any] = {}
    if as_written:
        options = {"dtype": str, "keep_default_na": False, "na_values": [""], "skip_blank_lines": False}
    table: pd.DataFrame = pd.read_csv(plain, index_col=False, **options)
    for name in table.columns[[kind.kind not in "fiub" for kind in table.dtypes]]:
        if table[name].astype(str).str.contains("'", regex=False).any():
            table[name] = table[name].map(
                lambda cell: unguarded_cell(cell) if isinstance(cell, str) else cell
            )
    return table


def write_table(file: Path, table: pd.DataFrame) -> None:
    """Write a table as CSV in which no name or text can run as a formula in a spreadsheet."""
    guarded = table.rename(columns=lambda name: guarded_cell(str(name)))
    for column, kind in enumerate(guarded.dtypes):
        if kind.kind not in "fiub":
            guarded.isetitem(column, guarded_row(guarded.iloc[:, column]))
    guarded.to_csv(file, index=False, lineterminator="\n")


def line_of(path: Path, row: int) -> int:
    """Line of a file with row `row` (from 0) of its table; blank lines are not rows.

    For messages: the file is read again.
    """
    if not is_delimited(path):
        reader = reader_of(path)
        return int(reader.cells(reader.header()).lines[row])
    return next((line for line, _ in islice(delimited_table(path).rows(), row, None)), row + 2)


def few(names: Sequence[str]) -> str:
    """The first names of columns; a table of face tracking has sixty, too many for a line."""
    rest = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {rest} more" if rest > 0 else "")


def _refuse_other_formats(path: Path) -> None:
    """Refuse files of other programs that hold no column of lid distances, and say what to do."""
    with path.open(encoding=encoding_of(path), newline="") as stream:
        lines = (line.strip() for line in stream)
        written = list(islice((line for line in lines if line), FIRST_LINES))
    first = [re.split(r"[,;\t]", line)[0].strip().strip('"').lower() for line in written]
    if any(word.startswith(EYELINK) for word in first) or path.suffix.lower() == ".asc":
        raise InputError(
            f"{path.name}: this is an EyeLink recording (gaze and pupil); expected a table with a column of "
            "lid distances. Track the lids in a video with 'stimuli track'"
        )
    if first[:2] == ["scorer", "bodyparts"] or first[:3] == ["scorer", "individuals", "bodyparts"]:
        raise InputError(
            f"{path.name}: this is a DeepLabCut table of points; expected a column of lid distances. Write "
            "the distance between an upper-lid and a lower-lid point to a CSV with one header line"
        )


def _read_decimal_commas(table: pd.DataFrame, separator: str) -> str:
    """Make numbers of the columns written with decimal commas; return one of their cells, or nothing."""
    example = ""
    for name in table.columns[[kind.kind not in "fiub" for kind in table.dtypes]]:
        words = [str(word).strip() for word in table[name].dropna()]
        commas = [word for word in words if "," in word]
        # Among quoted cells of a table with commas, 1,234 is as likely a thousand.
        thousands = separator == "," and all(map(_THOUSANDS.fullmatch, commas))
        if commas and not thousands and all(map(_COMMA_OR_WHOLE.fullmatch, words)):
            example = example or commas[0]
            table[name] = pd.to_numeric(table[name].astype(str).str.replace(",", "."), errors="coerce")
    return example
