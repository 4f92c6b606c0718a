"""A CSV with a header line as a table, however a spreadsheet wrote it: commas, semicolons or tabs."""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.errors import InputError, counted
from experiments.text_tables import (
    HEAD_BYTES,
    guarded_cell,
    guarded_row,
    separator_of,
    unguarded_cell,
    utf8_stream,
)

NOTE = "note"
"""Key of `DataFrame.attrs` under which a table says how it was read; absent where that is plain."""
MAX_NAMED = 6
FIRST_LINES = 40
"""Lines in which other programs' files are recognized."""
COMMENTS = ("#", "%")
"""Lines that begin so, above the header, are comments."""
EYELINK = ("** converted from", "** date:", "** type: edf")
_FIELDS = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")
_SEPARATORS = {";": "semicolons", "\t": "tabs"}
_POINT_OR_WHOLE = re.compile(r"[+-]?[0-9]*([.][0-9]+|(?<=[0-9])[.]?)([eE][+-]?[0-9]+)?")
_COMMA_OR_WHOLE = re.compile(r"[+-]?[0-9]*(,[0-9]+|(?<=[0-9]))([eE][+-]?[0-9]+)?")
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(,[0-9]{3})+")


def read_table(path: Path, *, alone: str = "", as_written: bool = False) -> pd.DataFrame:
    """Read a series, track, review, blink or table of profiles, column names stripped of blanks.

    The separator is taken from the header line. Decimal commas are read as points; `attrs[NOTE]` then
    says so, for the person to see.

    Parameters
    ----------
    path : Path
    alone : str
        A column that may be the file's only one: its commas are decimal. A first line that is a number
        without a comma is its first value, where no header line stands.
    as_written : bool
        Cells are the text in the file, and blank lines below the header are rows: only a blank is missing.

    Returns
    -------
    DataFrame

    Raises
    ------
    InputError
        A folder, no UTF-8 text, or no table with rows.
    """
    skipped, header = _header(path, named_by_comment=not alone)
    header = header.strip()
    headless = bool(alone and _POINT_OR_WHOLE.fullmatch(header))
    one_column = headless or header.strip('"') == (alone or None)
    separator = ";" if one_column else separator_of(header)
    options: dict[str, Any] = {"header": None, "names": [alone]} if headless else {}
    options |= {"skiprows": skipped} if skipped else {}
    if as_written:
        options |= {"dtype": str, "keep_default_na": False, "na_values": [""], "skip_blank_lines": False}
    table = _cells(path, sep=separator, **options)
    if header.startswith(COMMENTS):
        table.columns = table.columns.str.lstrip("".join(COMMENTS) + " ")
    said = [f"{counted(skipped, 'line')} of comment above the header skipped"] if skipped else []
    if separator in _SEPARATORS and not one_column:
        said.append(f"columns parted by {_SEPARATORS[separator]}")
    if example := _read_decimal_commas(table, separator):
        said.append(f"decimal commas (e.g. '{example}') read as decimal points")
    if said:
        table.attrs[NOTE] = f"{path.name}: {', '.join(said)}"
    return table


def _cells(path: Path, **options: Any) -> pd.DataFrame:
    """The cells as pandas reads them by these options; what is no table is refused."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            # Else a field too many makes the first column an index, and shifts the others under its name.
            with utf8_stream(path) as stream:
                table: pd.DataFrame = pd.read_csv(
                    stream, skipinitialspace=True, index_col=False, encoding="utf-8-sig", **options
                )
    except pd.errors.ParserWarning as error:
        raise InputError(
            f"{path}: rows have more fields than the header names columns; numbers with decimal commas want "
            "semicolons between columns"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: {_why_not_parsed(str(error))}") from error
    except pd.errors.EmptyDataError as error:
        raise InputError(f"{path}: expected a CSV table with a header line, got no column") from error
    table.columns = pd.Index([unguarded_cell(name.strip()) for name in table.columns.astype(str)])
    for name in table.columns[[kind.kind not in "fiub" for kind in table.dtypes]]:
        if table[name].astype(str).str.contains("'", regex=False).any():
            table[name] = table[name].map(
                lambda cell: unguarded_cell(cell) if isinstance(cell, str) else cell
            )
    if table.empty:
        raise InputError(f"{path}: the table has a header but no rows")
    return table


def write_table(file: Path, table: pd.DataFrame) -> None:
    """Write a table as CSV in which no name or text can run as a formula in a spreadsheet."""
    guarded = table.rename(columns=lambda name: guarded_cell(str(name)))
    for column, kind in enumerate(guarded.dtypes):
        if kind.kind not in "fiub":
            guarded.isetitem(column, guarded_row(guarded.iloc[:, column]))
    guarded.to_csv(file, index=False, lineterminator="\n")


def line_of(path: Path, row: int) -> int:
    """Line of a file on which row `row` (from 0) of its table stands; blank lines are no rows.

    For messages: the file is read again.
    """
    with utf8_stream(path) as stream:
        lines = stream.read().decode("utf-8-sig", "replace").split("\n")
    skipped, header = _header(path)
    blank = " \r" if "\t" in header else " \t\r"
    written = [n for n, line in enumerate(lines, start=1) if n > skipped and line.strip(blank)]
    return written[row + 1] if row + 1 < len(written) else row + 2


def few(names: Sequence[str]) -> str:
    """The first names of columns; a table of face tracking has sixty, too many for a line."""
    rest = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {rest} more" if rest > 0 else "")


def _why_not_parsed(message: str) -> str:
    """What a parser's message means for the person's file."""
    numbers = _FIELDS.search(message)
    if numbers is None:
        return "expected a CSV table with a header line; a double quote may be open: close it or delete it"
    expected, line, got = numbers.groups()
    return (
        f"line {line} has {got} fields, the header line {expected}; the first line must name the columns: "
        "delete lines above it"
    )


def _header(path: Path, *, named_by_comment: bool = True) -> tuple[int, str]:
    """How many lines of comment come first, and the line after them, blank ones left out.

    Where that line holds numbers alone, the comment right above it names the columns (`named_by_comment`), as
    NumPy writes tables.
    """
    if path.is_dir():
        raise InputError(f"{path}: expected a CSV file, this is a folder; name a file in it")
    try:
        with utf8_stream(path) as content:
            start = content.read(HEAD_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    try:
        lines = start.decode("utf-8-sig", "strict" if len(start) < HEAD_BYTES else "ignore").split("\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    _refuse_other_formats(lines, path)
    comments = 0
    for number, line in enumerate(lines):
        if line.startswith(COMMENTS):
            comments = number + 1
        elif line.strip():
            if named_by_comment and 0 < comments == number and _names_columns(lines[number - 1], line):
                return comments - 1, lines[number - 1]
            return comments, line
    raise InputError(f"{path} is empty; expected a CSV table with a header line")


def _names_columns(comment: str, line: str) -> bool:
    """Whether a comment has a name for each number of the line below it."""
    separator = separator_of(line)
    fields = [field.strip().strip('"') for field in line.split(separator)]
    forms = (_POINT_OR_WHOLE, _COMMA_OR_WHOLE)
    numbers = (
        field.lower() in ("", "nan") or any(form.fullmatch(field) for form in forms) for field in fields
    )
    return all(numbers) and len(comment.split(separator)) == len(fields)


def _refuse_other_formats(lines: Sequence[str], path: Path) -> None:
    """Refuse files of other programs that hold no column of lid distances, and say what to do."""
    written = [line.strip() for line in lines if line.strip()][:FIRST_LINES]
    first = [re.split(r"[,;\t]", line)[0].strip().strip('"').lower() for line in written]
    if any(word.startswith(EYELINK) for word in first) or path.suffix.lower() == ".asc":
        raise InputError(
            f"{path}: this is an EyeLink recording (gaze and pupil), expected a CSV table with a column of "
            "lid distances; track the lids in a video with 'stimuli track'"
        )
    if first[:2] == ["scorer", "bodyparts"] or first[:3] == ["scorer", "individuals", "bodyparts"]:
        raise InputError(
            f"{path}: this is a DeepLabCut table of points, expected a column of lid distances; write the "
            "distance between a point of the upper and one of the lower lid into a CSV with one header line"
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
