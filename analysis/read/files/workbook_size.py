"""The size of a workbook, looked at before it is opened: a few kilobytes may unfold to all memory."""

import zlib
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn
from xml.parsers import expat
from zipfile import BadZipFile, ZipFile, ZipInfo

from experiments.errors import InputError

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet

MAX_BYTES = 512 << 20
"""Of all parts unpacked; openpyxl takes a few times as much."""

MAX_ELEMENTS = 10_000_000
"""Of XML in all parts; a cell with a number has two, and takes half a kilobyte."""

MAX_AREA = 30_000_000
"""Cells from the first to the last, empty ones too, of a sheet, and of its merged areas and links."""

LAST_ROW, LAST_COLUMN = 1_048_576, 16_384
"""Of a sheet; a link over `A:C` reaches to the last row, one over `1:3` to the last column."""

_UNFOLDED = {"mergeCell": "merged cells", "hyperlink": "a link over cells", "comment": "a note over cells"}
"""Elements of whose area every cell is made, empty or not."""

_DAMAGED = (BadZipFile, zlib.error, EOFError, OSError, RuntimeError, expat.ExpatError)


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
            # whatever their names: a relation may name any part as a sheet
            for part in parts:
                elements = _counted(path, book, part, elements)
    except _DAMAGED:
        return


def refuse_too_far(path: Path, sheet: "Worksheet") -> None:
    """Refuse a sheet opened whose cells, few as they are, lie so far apart that the empty ones fill memory.

    Raises
    ------
    InputError
        More than MAX_AREA from the first to the furthest row and column.
    """
    rows, columns = sheet.max_row, sheet.max_column
    if rows * columns > MAX_AREA:
        _refuse(
            path,
            f"has cells as far as row {rows:,} and column {columns:,} of '{sheet.title}', "
            f"{rows * columns:,} with the empty ones between",
            "delete the rows and columns behind the table, or ",
        )


def _counted(path: Path, book: ZipFile, part: ZipInfo, elements: int) -> int:
    """The elements so far and those of a part: all, or those before what is no XML or damaged in it."""
    count = _Count(path, elements)
    try:
        with book.open(part) as file:
            count.parser.ParseFile(file)
    except _DAMAGED:
        # the reader says so where it needs this part; the parts behind are counted all the same
        pass
    return count.elements


class _Count:
    """What stands in a part: elements, and areas whose every cell is made."""

    def __init__(self, path: Path, elements: int) -> None:
        self.elements = elements
        self._path, self._unfolded, self._has_areas = path, 0, False
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._element
        self.parser.EntityDeclHandler = self._entity

    def _element(self, name: str, attributes: dict[str, str]) -> None:
        self.elements += 1
        if self.elements > MAX_ELEMENTS:
            _refuse(self._path, f"has more than {MAX_ELEMENTS // 2:,} cells")
        kind = name.rpartition(":")[2]
        if kind in _UNFOLDED:
            self._has_areas = True
            self._unfold(kind, attributes.get("ref", ""))
        elif kind == "ref" and self._has_areas:
            # openpyxl takes it for the attribute
            _refuse(self._path, "has an area written as an element, which no spreadsheet program does")

    def _unfold(self, kind: str, ref: str) -> None:
        cells = _area(ref)
        if cells > 1:
            self._unfolded += cells
            if self._unfolded > MAX_AREA:
                _refuse(
                    self._path,
                    f"has {_UNFOLDED[kind]} {ref}, {self._unfolded:,} in all",
                    "take them out, or ",
                )

    def _entity(self, *_: object) -> NoReturn:
        _refuse(self._path, "holds a document type with entities, which no spreadsheet program writes")


def _area(ref: str) -> int:
    """Cells in a reference, as openpyxl reads it: `A1:C9`, `$A$1:$C$9`, `A:C`, `1:9`; 0 of what is none."""
    from openpyxl.utils.cell import range_boundaries

    try:
        left, top, right, bottom = range_boundaries(ref)
    except ValueError:
        return 0
    columns = None if left is None or right is None else abs(right - left) + 1
    rows = None if top is None or bottom is None else abs(bottom - top) + 1
    return 0 if columns is None and rows is None else (columns or LAST_COLUMN) * (rows or LAST_ROW)


def _refuse(path: Path, what: str, remedy: str = "") -> NoReturn:
    raise InputError(f"{path.name} {what}; {remedy}save its sheet as CSV")
