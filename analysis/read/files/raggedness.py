"""The lines on which the rows of a CSV file begin; a row that has not the header's width is refused."""

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from analysis.read.files.quotes import lines_by_cells, wrong_width

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
