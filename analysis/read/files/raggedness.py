"""Find the first line of a CSV file whose number of cells differs from the header's."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

Bytes = NDArray[np.uint8]

_BLOCK = 1 << 24
_NEWLINE, _QUOTE, _RETURN = 10, 34, 13


def refuse_ragged(path: Path, separator: str, width: int) -> None:
    """Raise InputError naming the first line that has not `width` cells; blank lines are allowed.

    Needed because a parser told which columns to read drops surplus cells without a word.
    """
    line, carry = 1, np.empty(0, np.uint8)
    with path.open("rb") as file:
        while True:
            block = np.frombuffer(file.read(_BLOCK), np.uint8)
            end = block.size == 0
            carry = np.concatenate([carry, block if not end else np.array([_NEWLINE], np.uint8)])
            whole, lines = _check(carry, ord(separator), width, line, path.name)
            line, carry = line + lines, carry[whole:]
            if end:
                return


def _check(data: Bytes, separator: int, width: int, first_line: int, name: str) -> tuple[int, int]:
    """Check the whole lines of `data`; give back the bytes and the lines they took."""
    quotes = data == _QUOTE
    outside = np.bitwise_xor.accumulate(quotes.view(np.uint8)) == 0 if quotes.any() else ~quotes
    ends = np.flatnonzero((data == _NEWLINE) & outside)
    if ends.size == 0:
        return 0, 0
    before = np.searchsorted(np.flatnonzero((data == separator) & outside), ends)
    cells = np.diff(before, prepend=0) + 1
    lengths = np.diff(ends, prepend=-1) - 1
    starts = ends - lengths
    blank = (lengths == 0) | ((lengths == 1) & (data[np.minimum(starts, data.size - 1)] == _RETURN))
    wrong = np.flatnonzero((cells != width) & ~blank)
    if wrong.size:
        row = int(wrong[0])
        line = first_line + int((data[: starts[row]] == _NEWLINE).sum())
        raise InputError(
            f"{name}: line {line} has {cells[row]} cells, the header {width}; "
            "put cells that hold a separator in double quotes"
        )
    whole = int(ends[-1]) + 1
    return whole, int((data[:whole] == _NEWLINE).sum())
