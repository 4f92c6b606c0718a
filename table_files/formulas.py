"""Tables that a spreadsheet may open: no cell of them runs as a formula, and what readers undo of that."""

import csv
import io
import re
from collections.abc import Iterable, Iterator
from typing import Any

# Tables that a spreadsheet may open: no cell of them runs as a formula.
#
# A spreadsheet runs a cell that begins with = + - @ (or a full-width or small form of one, or a tab or line
# end before one) unless the cell is a number. Where its list separator is a semicolon, it also splits a
# cell at each semicolon, tab and line end and runs the parts. `guarded_cell` puts an apostrophe before each
# such part, which spreadsheets read as "this is text" (https://owasp.org/www-
# community/attacks/CSV_Injection). Our own readers take the apostrophe away again (`unguarded_cell`), so
# that a table keeps its texts on the way out and back.

_SIGNS = "=+\\-@＝＋－＠﹦﹢﹣﹫"
"""The signs that begin a formula, with their full-width and small forms, for a regular expression."""
_LEADING = re.compile(rf"[{_SIGNS}\t\r\n]")
# Inside a cell plus and minus count where an operand may follow: the ";-)" of a comment is not a formula.
_INNER = re.compile(r"(?<=[;\t\r\n])(?=[=@＝＠﹦﹫]|[+\-＋－﹢﹣][^)\]/|;\t\r\n])")
_GUARDED = re.compile(rf"(^|[;\t\r\n])'(?=[{_SIGNS}\t\r\n])")
_PARTED = re.compile(r"[;\t\r\n]")
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\s*")
_STARTS = (b",", b"\n", b"\r", b'"', b";", b"\t")
"""What precedes a cell of a line of CSV, or a part of one."""
_SUSPICIOUS = (b"=", b"@", b"\t", b"\r", b"\xef\xbc", b"\xef\xb9")
"""Signs that are rare in tables; the last two are the first bytes of the full-width and the small forms."""
_PLAIN = rb"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_SIGNED = re.compile(
    rb'[+-](?<=[,\n\r;\t"][+-])(?:(?<=,[+-])(?!' + _PLAIN + rb'[,\n])|(?<="[+-])(?!' + _PLAIN + rb'"(?!"))'
    rb"|(?<=[;\t\n\r][+-])(?!" + _PLAIN + rb'(?:[;\n]|"(?!"))))'
)
"""A plus or minus there that does not begin a plain number. In quotes a comma does not end a number: German
spreadsheets read -1,1+A1 as a formula."""


def guarded_cell(cell: str) -> str:
    """The cell as text wherever a spreadsheet would run it.

    >>> guarded_cell("=1+1"), guarded_cell("-1.5"), guarded_cell("-1+cmd"), guarded_cell("safe")
    ("'=1+1", '-1.5', "'-1+cmd", 'safe')
    >>> guarded_cell("thanks;=1+1"), guarded_cell("well ;-)")
    ("thanks;'=1+1", 'well ;-)')
    """
    if _LEADING.match(cell) and not _NUMBER.fullmatch(cell):
        cell = f"'{cell}"
    return _INNER.sub(_apostrophe, cell) if _PARTED.search(cell) else cell


def _apostrophe(match: re.Match[str]) -> str:
    part = _PARTED.split(match.string[match.start() :], maxsplit=1)[0]
    return "" if _NUMBER.fullmatch(part) else "'"


def unguarded_cell(cell: str) -> str:
    """The cell that `guarded_cell` was given; any other cell as it is.

    >>> unguarded_cell("'=1+1"), unguarded_cell("'tis"), unguarded_cell("-1")
    ('=1+1', "'tis", '-1')
    """
    if "'" not in cell:
        return cell
    plain = _GUARDED.sub(r"\1", cell)
    return plain if plain != cell and guarded_cell(plain) == cell else cell


def guarded_row(row: Iterable[Any]) -> list[Any]:
    """A row of a table with its texts guarded; numbers and empty cells stay."""
    return [guarded_cell(cell) if isinstance(cell, str) else cell for cell in row]


def guarded_table(rows: Iterable[Iterable[Any]]) -> bytes:
    """A small table, header included, as guarded CSV in UTF-8."""
    return csv_text(map(guarded_row, rows)).encode("utf-8")


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as CSV whose lines end in a line feed, texts as they are."""
    return "".join(f"{line}\n" for line in csv_lines(rows))


def csv_lines(rows: Iterable[Iterable[Any]]) -> list[str]:
    r"""Each row as a line of CSV without its end.

    The writer quotes what is in its line end alone: with "\n" it would leave a lone "\r" bare, which readers
    take for the end of a row. It calls `write` once per row.
    """
    lines = _Lines()
    csv.writer(lines, lineterminator="\r\n").writerows(rows)
    return [line[:-2] for line in lines]


class _Lines(list[str]):
    write = list.append


def guarded_csv(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Pieces of CSV in UTF-8 (each of whole rows) with every cell guarded.

    A piece in which no cell can be a formula passes as it is: a few searches instead of reading and writing
    the rows again.
    """
    for piece in pieces:
        line = b"\n" + piece  # so that the first cell has something before it
        yield _guarded_piece(piece) if _may_hold_formula(line) else piece


def _may_hold_formula(line: bytes) -> bool:
    # Finding one byte is many times faster than finding a pair, so the pairs wait for the sign.
    if any(sign in line and any(start + sign in line for start in _STARTS) for sign in _SUSPICIOUS):
        return True
    return b',"\n' in line or b'\n"\n' in line or _SIGNED.search(line) is not None


def _guarded_piece(piece: bytes) -> bytes:
    csv.field_size_limit(max(csv.field_size_limit(), len(piece)))  # a long comment is not an error
    return guarded_table(csv.reader(io.StringIO(piece.decode("utf-8"), newline="")))
