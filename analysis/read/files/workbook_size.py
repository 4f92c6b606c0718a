"""The size of a workbook, looked at before it is opened: a few kilobytes may unfold to all memory."""

import re
import zlib
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat
from zipfile import BadZipFile, ZipFile

from experiments.errors import InputError

MAX_BYTES = 512 << 20
"""Of all parts unpacked; openpyxl takes a few times as much."""

MAX_ELEMENTS = 10_000_000
"""Of XML in all parts; a cell with a number has two, and takes half a kilobyte."""

MAX_AREA = 30_000_000
"""Cells from the first to the last, empty ones too, of a sheet, and of its merged areas and links."""

_CELL = re.compile("([A-Za-z]{1,3})([0-9]{1,7})")
_AREA = re.compile("([A-Za-z]{1,3})([0-9]{1,7}):([A-Za-z]{1,3})([0-9]{1,7})")
_UNFOLDED = ("mergeCell", "hyperlink")
"""Elements of whose area every cell is made, empty or not."""


def refuse_too_large(path: Path) -> None:
    """Refuse a workbook that cannot be held in memory; whatever else is wrong with it is left to its reader.

    Raises
    ------
    InputError
        Too many bytes or cells, or a document type, which no spreadsheet program writes.
    """
    try:
        with ZipFile(path) as book:
            parts = book.infolist()
            size = sum(part.file_size for part in parts)
            if size > MAX_BYTES:
                _refuse(path, f"unpacks to {size >> 20:,} MiB, and at most {MAX_BYTES >> 20} are read")
            elements = 0
            for part in parts:
                if part.filename.lower().endswith((".xml", ".rels")):
                    count = _Count(path, elements)
                    with book.open(part) as file:
                        count.parser.ParseFile(file)
                    elements = count.elements
    except (BadZipFile, zlib.error, EOFError, OSError, RuntimeError, expat.ExpatError):
        return


class _Count:
    """What stands in a part: elements, the furthest row and column, areas whose every cell is made."""

    def __init__(self, path: Path, elements: int) -> None:
        self.elements = elements
        self._path, self._row, self._column, self._unfolded = path, 0, 0, 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._element
        self.parser.StartDoctypeDeclHandler = self._document_type

    def _element(self, name: str, attributes: dict[str, str]) -> None:
        self.elements += 1
        if self.elements > MAX_ELEMENTS:
            _refuse(self._path, f"has more than {MAX_ELEMENTS // 2:,} cells")
        kind = name.rpartition(":")[2]
        if kind == "c" and (at := _CELL.fullmatch(attributes.get("r", ""))):
            self._row, self._column = max(self._row, int(at[2])), max(self._column, _number(at[1]))
            if self._row * self._column > MAX_AREA:
                _refuse(
                    self._path,
                    f"has a cell {at[0]}, so that {self._row * self._column:,} cells lie before it, most of "
                    "them empty",
                    "delete the rows and columns behind the table, or ",
                )
        elif kind in _UNFOLDED and (area := _AREA.fullmatch(attributes.get("ref", ""))):
            rows = abs(int(area[4]) - int(area[2])) + 1
            self._unfolded += rows * (abs(_number(area[3]) - _number(area[1])) + 1)
            if self._unfolded > MAX_AREA:
                what = "merged cells" if kind == "mergeCell" else "a link over cells"
                _refuse(self._path, f"has {what} {area[0]}, {self._unfolded:,} in all", "take them out, or ")

    def _document_type(self, *_: object) -> NoReturn:
        _refuse(self._path, "holds a document type, which no spreadsheet program writes")


def _number(letters: str) -> int:
    """The number of a column, A is 1."""
    number = 0
    for letter in letters.upper():
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


def _refuse(path: Path, what: str, remedy: str = "") -> NoReturn:
    raise InputError(f"{path.name} {what}; {remedy}save its sheet as CSV")
