"""CSV and its kin: comma, semicolon or tab, taken from the header line."""

import csv
import re
import warnings
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.read.files.cells import Cells
from experiments.errors import InputError
from experiments.text_tables import separator_of, unguarded_cell, utf8_stream

# Double quotes of a CSV file that do not enclose whole cells: what is said of them.

_QUOTED = re.compile(rb'"(?:[^"]|"")*(?P<close>"|\Z)')


def lines_by_cells(data: bytes, separator: str, width: int, name: str) -> list[int]:
    """The line on which every row begins, from the cells of a whole file one by one, as a parser takes them.

    Quotes within a cell that does not begin with one are text. Blank lines are no rows.

    Raises
    ------
    InputError
        A quote that is never closed, a cell that goes on behind its closing quote, or a line that has not
        `width` cells.
    """
    first, line = 1, 1
    cells, begun = 0, []
    for cell, blank, ends_row in _cells(data, separator.encode(), name):
        cells += 1
        line += cell.count(b"\n")
        if not ends_row:
            continue
        empty = blank and cells == 1
        if cells != width and not empty:
            raise wrong_width(name, first, line, cells, width)
        begun += [] if empty else [first]
        line += 1
        first, cells = line, 0
    return begun


def wrong_width(name: str, first: int, last: int, cells: int, width: int) -> InputError:
    """A row of too many or too few cells that stands in the lines `first` to `last`."""
    if last > first:
        return InputError(
            f"{name}: line {first} opens a double quote that line {last} closes, so that these lines are one "
            f"row of {cells} cells, the header {width}; close the quote where its cell ends, or delete it"
        )
    return InputError(
        f"{name}: line {first} has {cells} cells, the header {width}; "
        "put cells that hold a separator in double quotes"
    )


def _cells(data: bytes, separator: bytes, name: str) -> Iterator[tuple[bytes, bool, bool]]:
    """Every cell as written, whether it is empty, and whether its row ends behind it."""
    plain = re.compile(rb"[^" + re.escape(separator) + rb"\n]*")
    at, size = 0, len(data)
    while at < size:
        cell = plain.match(data, at)
        if data.startswith(b'"', at):
            cell = _quoted(data, at, separator, name)
        if cell is None:
            return
        at = cell.end() + 1
        yield cell[0], not cell[0].strip(), not data.startswith(separator, cell.end())


def _quoted(data: bytes, at: int, separator: bytes, name: str) -> re.Match[bytes] | None:
    cell = _QUOTED.match(data, at)
    opened = data.count(b"\n", 0, at) + 1
    if cell is None or not cell["close"]:
        raise InputError(
            f"{name}: the double quote that line {opened} opens is never closed; close it or delete it"
        )
    behind = data[cell.end() : cell.end() + 2]
    if behind and not behind.startswith((separator, b"\n", b"\r\n")) and behind != b"\r":
        closed = opened + cell[0].count(b"\n")
        raise InputError(
            f"{name}: line {opened} opens a double quote that line {closed} closes, and the cell goes on "
            "behind it; write a double quote inside a cell twice, or delete it"
        )
    return cell


# The lines on which the rows of a CSV file begin; a row that has not the header's width is refused.

Bytes = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Lines = NDArray[np.int64]

_BLOCK = 1 << 24
_NEWLINE, _QUOTE, _RETURN = 10, 34, 13
_MARK = b"\xef\xbb\xbf"


def lines_of_rows(file: BinaryIO, separator: str, width: int, name: str) -> Lines:
    """The line on which every row begins, the header's first; blank lines are no rows.

    Needed because a parser told which columns to read drops surplus cells without a word. Files whose double
    quotes do not enclose whole cells are gone through cell by cell, which takes longer.

    Parameters
    ----------
    file : BinaryIO
        The file, UTF-8 with or without byte order mark, opened at its beginning.

    Raises
    ------
    InputError
        A row that has not `width` cells, or a damaged quote, with its line.
    """
    line, carry = 1, np.empty(0, np.uint8)
    begun: list[Lines] = []
    if file.read(len(_MARK)) != _MARK:
        file.seek(0)
    while True:
        block = np.frombuffer(file.read(_BLOCK), np.uint8)
        end = block.size == 0
        carry = np.concatenate([carry, block if not end else np.array([_NEWLINE], np.uint8)])
        outside = _outside_quotes(carry, ord(separator), end)
        if outside is None:
            file.seek(0)
            data = file.read().removeprefix(_MARK)
            return np.array(lines_by_cells(data, separator, width, name), dtype=np.int64)
        whole, lines, of_rows = _check(carry, outside, ord(separator), width, line, name)
        begun.append(of_rows)
        line, carry = line + lines, carry[whole:]
        if end:
            return np.concatenate(begun)


def _outside_quotes(data: Bytes, separator: int, end: bool) -> Flags | None:
    """Which bytes stand outside of quoted cells; None where a quote stands in the midst of a cell.

    `data` begins with a line; unless it is the `end` of the file its last line may be cut off.
    """
    quotes: Flags = data == _QUOTE
    if not quotes.any():
        return np.asarray(~quotes)
    at = np.flatnonzero(quotes)
    if end and at.size % 2:
        return None
    edges = np.zeros(256, dtype=bool)
    edges[[separator, _NEWLINE, _RETURN, _QUOTE]] = True
    opens, closes = at[0::2], at[1::2]
    before = data[np.maximum(opens - 1, 0)]
    behind = data[np.minimum(closes + 1, data.size - 1)]
    if not ((opens == 0) | edges[before]).all() or not edges[behind].all():
        return None
    inside: Bytes = np.bitwise_xor.accumulate(quotes.view(np.uint8))
    return np.asarray(inside == 0)


def _check(
    data: Bytes, outside: Flags, separator: int, width: int, first_line: int, name: str
) -> tuple[int, int, Lines]:
    """Check the whole lines of `data`; give back the bytes and the lines they took, and the rows' lines."""
    ends = np.flatnonzero((data == _NEWLINE) & outside)
    if ends.size == 0:
        return 0, 0, np.empty(0, np.int64)
    before = np.searchsorted(np.flatnonzero((data == separator) & outside), ends)
    cells = np.diff(before, prepend=0) + 1
    lengths = np.diff(ends, prepend=-1) - 1
    starts = ends - lengths
    blank = (lengths == 0) | ((lengths == 1) & (data[np.minimum(starts, data.size - 1)] == _RETURN))
    wrong = np.flatnonzero((cells != width) & ~blank)
    if wrong.size:
        row = int(wrong[0])
        first = first_line + int((data[: starts[row]] == _NEWLINE).sum())
        last = first + int((data[starts[row] : ends[row]] == _NEWLINE).sum())
        raise wrong_width(name, first, last, int(cells[row]), width)
    whole = int(ends[-1]) + 1
    newlines = np.flatnonzero(data[:whole] == _NEWLINE)
    return whole, len(newlines), first_line + np.searchsorted(newlines, starts[~blank]).astype(np.int64)


def delimited_header(path: Path) -> tuple[list[str], str]:
    """Names of the columns, and the separator."""
    try:
        with TextIOWrapper(utf8_stream(path), encoding="utf-8-sig", newline="") as lines:
            first = lines.readline()
            separator = separator_of(first)
            lines.seek(0)
            rows = csv.reader(lines, delimiter=separator)
            header = next(rows, [])
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    except csv.Error as error:
        raise InputError(f"{path.name} is not a CSV file: {error}") from error
    if not any(name.strip() for name in header):
        raise InputError(f"{path.name} is empty; expected a header line and one row a trial")
    return [unguarded_cell(name.strip()) for name in header], separator


def delimited_cells(path: Path, names: list[str]) -> Cells:
    """The columns `names` of a CSV file; rows of unequal length are refused."""
    header, separator = delimited_header(path)
    with utf8_stream(path) as file:
        lines = lines_of_rows(file, separator, len(header), path.name)[1:]
    frame = _parse(path, separator, [header.index(name) for name in names], len(header))
    frame.columns = pd.Index(names)
    if len(lines) != len(frame):  # a header of several lines, or cells of blanks in a table of one column
        lines = np.arange(len(frame), dtype=np.int64) + 2
    return Cells(frame, tuple(header), lines)


def _parse(path: Path, separator: str, positions: list[int], width: int) -> pd.DataFrame:
    try:
        with warnings.catch_warnings(), utf8_stream(path) as file:
            warnings.simplefilter("error")
            frame = pd.read_csv(
                file,
                sep=separator,
                header=None,
                skiprows=1,
                names=range(width),
                usecols=sorted(positions),
                dtype=str,
                keep_default_na=False,
                encoding="utf-8-sig",
                index_col=False,
                skip_blank_lines=True,
            )
    except pd.errors.EmptyDataError:
        return pd.DataFrame(columns=positions)
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        text = " ".join(str(error).split())
        raise InputError(f"{path.name}: not a CSV file ({text})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text ({error.reason}); save it as CSV UTF-8") from error
    chosen = frame[positions].copy()
    for column in chosen:
        # An export writes an apostrophe before texts that would run as formulas.
        if chosen[column].str.contains("'", regex=False).any():
            chosen[column] = chosen[column].map(unguarded_cell)
    return chosen
