"""CSV and its kin, by the standard library: any Unicode encoding or Windows-1252, comma, semicolon or tab."""

import codecs
import csv
import io
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TextIO

from table_files import InputError, counted
from table_files.formulas import unguarded_cell

# The encoding, from the bytes alone.

_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
"""Byte order marks of encodings that spreadsheets write besides UTF-8, the longer first."""
TABLE_ENDINGS = (".csv", ".tsv", ".txt", ".xlsx", ".sav", ".json")
"""How the names of tables end, as messages list them."""
_TEXT_ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".tab", ".json", ".jsonl")
_HEAD_BYTES = 1 << 12
_BLOCK_BYTES = 1 << 20
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_UTF8_LETTER = re.compile(rb"[\xc2-\xdf][\x80-\xbf]|[\xe0-\xef][\x80-\xbf]{2}|[\xf0-\xf4][\x80-\xbf]{3}")
_BEYOND_ASCII = re.compile(rb"[\x80-\xff]")
_WORD_BEYOND_ASCII = re.compile(r"\w*[^\W\x00-\x7f]\w*")
WINDOWS = "cp1252"
"""What Excel writes as plain CSV in western Europe and America; Latin-1 is a part of it."""


def encoding_of(path: Path) -> str:
    """The encoding of a text file, for `open`: UTF-8, UTF-16 or UTF-32, with a byte order mark or without.

    Text that is none of these is Windows-1252 where it can be: no control characters, and no letters of UTF-8
    of which one was cut or damaged.

    Raises
    ------
    InputError
        The file is not text in the encoding that its first bytes announce, or in any of these.
    """
    with path.open("rb") as file:
        start = file.read(_HEAD_BYTES)
    encoding = next((name for mark, name in _MARKS if start.startswith(mark)), None) or _without_mark(start)
    if encoding is None and b"\0" in start:
        raise _not_text(path, "UTF-8", "it holds null bytes")
    reason = _undecodable(path, encoding or "utf-8")
    if not reason:
        return encoding or "utf-8-sig"
    if encoding is None and _is_windows_text(path.read_bytes()):
        return WINDOWS
    raise _not_text(path, encoding or "UTF-8", reason)


def _not_text(path: Path, encoding: str, reason: str) -> InputError:
    """A table with a damaged encoding, or a file of another kind, such as a video."""
    if path.suffix.lower() not in _TEXT_ENDINGS:
        return InputError(
            f"'{path.name}' is not a table; expected a file ending in {', '.join(TABLE_ENDINGS)}"
        )
    return InputError(f"{path.name} is not {encoding} text ({reason}); save it as CSV UTF-8")


def text_of(path: Path) -> str:
    """The text of a whole file, whatever its encoding, line ends as they are."""
    with path.open(encoding=encoding_of(path), newline="") as stream:
        return stream.read()


def _undecodable(path: Path, encoding: str) -> str:
    """Why the bytes are not text in an encoding; empty if they are."""
    decoder = codecs.getincrementaldecoder(encoding)()
    try:
        with path.open("rb") as file:
            while block := file.read(_BLOCK_BYTES):
                decoder.decode(block)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError as error:
        return error.reason
    return ""


def _is_windows_text(data: bytes) -> bool:
    # A file of UTF-8 that was cut, or of which a byte is damaged, has other letters that are whole: as
    # Windows-1252 every one of them would be read as two wrong ones.
    whole = sum(map(len, _UTF8_LETTER.findall(data)))
    if _CONTROL.search(data) or 2 * whole > len(_BEYOND_ASCII.findall(data)):
        return False
    try:
        data.decode(WINDOWS)
    except UnicodeDecodeError:
        return False
    return True


def _without_mark(start: bytes) -> str | None:
    """UTF-16 or UTF-32 by where the null bytes of its plain letters are; None for other texts."""
    part = start[:256]
    if len(part) < 4 or b"\0" not in part:
        return None
    empty = [part[offset::4].count(0) / len(part[offset::4]) for offset in range(4)]
    if min(empty[1:]) > 0.9 and empty[0] < 0.1:
        return "UTF-32-LE"
    if min(empty[:3]) > 0.9 and empty[3] < 0.1:
        return "UTF-32-BE"
    if min(empty[1], empty[3]) > 0.7 and max(empty[0], empty[2]) < 0.1:
        return "UTF-16-LE"
    if min(empty[0], empty[2]) > 0.7 and max(empty[1], empty[3]) < 0.1:
        return "UTF-16-BE"
    return None


# The dialect, from the lines down to the header.

_SEPARATORS = ",;\t"
_QUOTED = re.compile(r'"[^"]*"')
COMMENTS = ("#", "%")
"""Lines that begin so, above the header, are comments."""
_POINT_OR_WHOLE = re.compile(r"[+-]?[0-9]*([.][0-9]+|(?<=[0-9])[.]?)([eE][+-]?[0-9]+)?")
_NUMBER = re.compile(r"[+-]?[0-9]*([.,][0-9]+|(?<=[0-9])[.]?)([eE][+-]?[0-9]+)?")


def separator_of(header: str) -> str:
    """The separator of a header line: the most frequent of comma, semicolon and tab outside quotes."""
    return max(_SEPARATORS, key=_QUOTED.sub("", header).count)


class _Head(NamedTuple):
    """How many lines are above the header, and the header's first line (or the first of cells)."""

    skipped: int
    line: str


def _find_head(lines: Iterator[str], name: str, named_by_comment: bool) -> _Head:
    """Where the header is: below comments and blank lines, or the comment right above a line of numbers.

    NumPy writes the names of columns as a comment (`named_by_comment`): it has a name for each cell of the
    line below it, and that line has a number, which names of columns are not.
    """
    comments, comment = 0, ""
    for number, line in enumerate(lines):
        if line.startswith(COMMENTS):
            comments, comment = number + 1, line
        elif line.strip():
            if named_by_comment and 0 < comments == number and _names_columns(comment, line):
                return _Head(comments - 1, comment)
            return _Head(comments, line)
    raise InputError(f"{name} is empty; expected a table with a header line")


def _names_columns(comment: str, line: str) -> bool:
    separator = separator_of(line)
    fields = [field.strip().strip('"') for field in line.split(separator)]
    return len(comment.split(separator)) == len(fields) and any(map(_NUMBER.fullmatch, fields))


class NamedRows(NamedTuple):
    """The names of a table's columns, and each row as its cells by these names, with its line."""

    header: Sequence[str]
    rows: Iterator[tuple[int, dict[str, str]]]


@dataclass(frozen=True)
class DelimitedTable:
    """A table of text whose header is read, and whose rows are read when they are asked for.

    Attributes
    ----------
    name : str
        The file's name, for messages.
    header : tuple of str
        Names of the columns, stripped.
    separator : str
    notes : tuple of str
        How it was read, where that is not plain: encoding, comments.
    """

    name: str
    header: tuple[str, ...]
    separator: str
    notes: tuple[str, ...]
    _open: Callable[[], TextIO]
    _skipped: int
    _headless: bool

    def rows(self, blank_lines: bool = False) -> Iterator[tuple[int, list[str]]]:
        """Each row with the line on which it begins; lines without a cell are rows where `blank_lines` count.

        Raises
        ------
        InputError
            A row that has not as many cells as the header, or a damaged quote, with its line.
        """
        width, empty = len(self.header), [""] * len(self.header)
        for first, last, row in self._cells():
            if len(row) == width:  # of one column "" is a row too, as pandas writes a value that is missing
                yield first, row
            elif not row or (len(row) == 1 and not row[0].strip()):
                if blank_lines:
                    yield first, empty
            elif len(row) == width + 1 and not row[-1]:
                yield first, row[:-1]  # each row ends in a separator
            else:
                raise _wrong_width(self.name, first, last, len(row), width)

    def columns(self, names: Sequence[str]) -> tuple[list[tuple[str, ...]], list[int]]:
        """The cells of some columns, row by row as they are in the file, and the lines of the rows."""
        positions = [self.header.index(name) for name in names]
        rows, lines = [], []
        for line, row in self.rows():
            rows.append(tuple([row[position] for position in positions]))
            lines.append(line)
        return rows, lines

    def named_rows(self) -> NamedRows:
        """The rows as they were before a writer guarded them, read one at a time."""
        rows = ((line, map(unguarded_cell, row)) for line, row in self.rows())
        return NamedRows(
            self.header, ((line, dict(zip(self.header, row, strict=True))) for line, row in rows)
        )

    def _cells(self) -> Iterator[tuple[int, int, list[str]]]:
        """Every row below the header as its first line, its last line and its cells."""
        with self._open() as stream:
            parsed = _parsed_lines(stream, self.separator, self._skipped, self.name)
            if not self._headless:
                next((row for *_, row in parsed if any(cell.strip() for cell in row)), None)
            yield from parsed


def _parsed_lines(
    stream: TextIO, separator: str, skipped: int, name: str
) -> Iterator[tuple[int, int, list[str]]]:
    for _ in range(skipped):
        stream.readline()
    csv.field_size_limit(sys.maxsize)  # a long comment is not an error
    reader = csv.reader(stream, delimiter=separator, skipinitialspace=True, strict=True)
    first = skipped + 1
    try:
        for row in reader:
            last = skipped + reader.line_num
            yield first, last, row
            first = last + 1
    except csv.Error as error:
        raise _damaged_quote(name, first, skipped + reader.line_num, str(error)) from error


def _damaged_quote(name: str, first: int, last: int, said: str) -> InputError:
    if "unexpected end" in said:
        return InputError(
            f"{name}: the double quote that line {first} opens is never closed; close it or delete it"
        )
    if "expected after" in said:
        return InputError(
            f"{name}: line {first} opens a double quote that line {last} closes, and the cell goes on "
            "behind it; write a double quote inside a cell twice, or delete it"
        )
    return InputError(f"{name}: line {first} is not CSV that can be read ({said}); write it again")


def _wrong_width(name: str, first: int, last: int, cells: int, width: int) -> InputError:
    """A row of too many or too few cells in the lines `first` to `last`."""
    if last > first:
        return InputError(
            f"{name}: line {first} opens a double quote that line {last} closes, so that these lines are one "
            f"row of {cells} cells, the header {width}; close the quote where its cell ends, or delete it"
        )
    return InputError(
        f"{name}: line {first} has {cells} cells, the header {width}; put cells that hold a separator in "
        "double quotes, part columns by semicolons where commas are decimal, delete lines above the header"
    )


def delimited_table(path: Path, *, alone: str = "") -> DelimitedTable:
    """A file of text as a table.

    Parameters
    ----------
    path : Path
    alone : str
        A column that may be the file's only one: its commas are decimal. A first line that is a number
        without a comma is its first value, if there is no header line.

    Raises
    ------
    InputError
        No text, or no header line.
    """
    try:
        encoding = encoding_of(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    notes = (_windows_note(path),) if encoding == WINDOWS else ()
    return _table(lambda: path.open(encoding=encoding, newline=""), path.name, notes, alone)


def table_of_text(text: str, name: str) -> DelimitedTable:
    """Text that came without a file as a table; messages call it by `name`."""
    return _table(lambda: io.StringIO(text.removeprefix("\ufeff"), newline=""), name, (), "")


def _table(open_text: Callable[[], TextIO], name: str, notes: tuple[str, ...], alone: str) -> DelimitedTable:
    with open_text() as stream:
        skipped, line = _find_head(stream, name, named_by_comment=not alone)
    line = line.strip("\r\n \ufeff")
    headless = bool(alone and _POINT_OR_WHOLE.fullmatch(line))
    one_column = headless or line.strip('"') == (alone or None)
    separator = ";" if one_column else separator_of(line)
    names = [alone] if headless else _header_names(open_text, separator, skipped, name)
    if line.startswith(COMMENTS):
        names = [each.lstrip("".join(COMMENTS) + " ") for each in names]
    if skipped:
        notes = (f"{counted(skipped, 'line')} of comment above the header skipped", *notes)
    return DelimitedTable(name, tuple(names), separator, notes, open_text, skipped, headless)


def _header_names(open_text: Callable[[], TextIO], separator: str, skipped: int, name: str) -> list[str]:
    with open_text() as stream:
        parsed = _parsed_lines(stream, separator, skipped, name)
        header = next((row for *_, row in parsed if any(cell.strip() for cell in row)), [])
    if not header:
        raise InputError(f"{name} is empty; expected a table with a header line")
    return [unguarded_cell(each.strip()) for each in header]


def _windows_note(path: Path) -> str:
    word = _WORD_BEYOND_ASCII.search(path.read_text(encoding=WINDOWS))
    example = f" (e.g. '{word[0]}')" if word else ""
    return f"read as Windows-1252, since it is not UTF-8{example}"
