"""CSV that a spreadsheet opens rightly: marked as UTF-8, and no cell of it can run as a formula.

A cell that begins with = + - @ (or a tab or line end before one) is a formula to a spreadsheet, unless it is
a number. Such a cell gets an apostrophe before it, which spreadsheets take as "this is text"
(https://owasp.org/www-community/attacks/CSV_Injection).
"""

import csv
import io
from collections.abc import Iterable, Iterator

from server.text import encoded

MARK = "\ufeff".encode()
"""The byte order mark, by which Excel knows UTF-8."""
_BEGINS = ("=", "+", "-", "@", "\t", "\r", "\n")


def marked(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces after a byte order mark."""
    yield MARK
    yield from pieces


def guarded(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces (each of whole rows) with every cell that a spreadsheet would run made text."""
    for piece in pieces:
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        for row in csv.reader(io.StringIO(piece.decode("utf-8"), newline="")):
            writer.writerow([guarded_cell(cell) for cell in row])
        yield encoded(stream.getvalue())


def guarded_cell(cell: str) -> str:
    """The cell, as text where a spreadsheet would run it.

    >>> guarded_cell("=1+1"), guarded_cell("-1.5"), guarded_cell("-1+cmd"), guarded_cell("safe")
    ("'=1+1", '-1.5', "'-1+cmd", 'safe')
    """
    return f"'{cell}" if cell.startswith(_BEGINS) and not _is_number(cell) else cell


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return cell == cell.strip()
