"""Double quotes of a CSV file that do not enclose whole cells: what is said of them."""

import re
from collections.abc import Iterator

from experiments.errors import InputError

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
