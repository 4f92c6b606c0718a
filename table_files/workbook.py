"""Excel workbooks (.xlsx): one sheet, its first row the header."""

import zlib
from dataclasses import dataclass
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn
from xml.parsers import expat
from zipfile import BadZipFile, ZipFile, ZipInfo

from table_files import InputError, did_you_mean
from table_files.cells import Cells, cells_of

if TYPE_CHECKING:
    from openpyxl.worksheet.worksheet import Worksheet


# The size of a workbook, looked at before it is opened: a few kilobytes may unfold to all memory.

MAX_BYTES = 512 << 20
"""For all parts unpacked; openpyxl takes a few times as much."""

MAX_ELEMENTS = 10_000_000
"""XML elements in all parts; a cell with a number has two, and takes half a kilobyte."""

MAX_AREA = 30_000_000
"""Cells from the first to the last, empty ones too, of a sheet, and of its merged areas and links."""

LAST_ROW, LAST_COLUMN = 1_048_576, 16_384
"""The last ones of a sheet; a link over `A:C` reaches to the last row, one over `1:3` to the last column."""

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
    """The elements so far and those of a part: all, or those before what is not XML or damaged in it."""
    count = _Count(path, elements)
    try:
        with book.open(part) as file:
            count.parser.ParseFile(file)
    except _DAMAGED:
        # the reader says so where it needs this part; the parts behind are counted all the same
        pass
    return count.elements


class _Count:
    """The content of a part: elements, and areas whose every cell is made."""

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


Rows = list[list[Any]]


@dataclass(frozen=True)
class Page:
    """A sheet from its first row that holds anything, row `first`, to the last, and its merged cells.

    `merged` has a text like `A2:A4` and the rows and columns from and to, counted from 1; `hidden` counts
    rows with values that a filter or a person hid; `more` says that cells without a value follow below.
    """

    rows: Rows
    first: int
    merged: tuple[tuple[str, int, int, int, int], ...]
    hidden: int
    more: bool


_UNREADABLE = (
    *(BadZipFile, zlib.error, EOFError, OSError, KeyError, ValueError),
    *(AttributeError, TypeError, IndexError, SyntaxError, RuntimeError),
)
"""What openpyxl raises of damaged workbooks: SyntaxError of broken XML, RuntimeError of a password."""


def header(path: Path, sheet: str | None) -> list[str]:
    """Names of the columns of a sheet."""
    return _header(path, _page(path, sheet)[1])


def cells(path: Path, sheet: str | None, names: list[str]) -> Cells:
    """The columns `names` of a sheet; a formula that Excel never calculated is refused, it has no value."""
    title, page = _page(path, sheet)
    columns = _header(path, page)
    width = len(columns)
    body = [(row + [None] * width)[:width] for row in page.rows[1:]]
    _refuse_merged(path, page, columns, names)
    _refuse_uncalculated(path, title, columns, body, names)
    said = (
        f"read from the sheet '{title}' of {path.name}",
        *_hidden_rows(page),
        *_dates_beside(page, columns, body, names),
    )
    return cells_of(columns, body, names, page.first + 1, decisions=said)


def _header(path: Path, page: Page) -> list[str]:
    for text, low, left, high, right in page.merged:
        if low <= page.first <= high and right > left:
            raise InputError(
                f"{path.name}: the first row has merged cells ({text}); expected one row that names every "
                "column. Unmerge them, give each column its own name (blur_calm), and delete rows above"
            )
    names = ["" if value is None else str(value).strip() for value in page.rows[0]] if page.rows else []
    while names and not names[-1]:
        names.pop()
    if not names:
        raise InputError(f"{path.name} is empty; expected a header row and one row per trial")
    return names


def _refuse_merged(path: Path, page: Page, columns: list[str], names: list[str]) -> None:
    """Merged cells of a column that is read: all but the first are empty, whatever the sheet looks like."""
    for text, _, left, high, right in page.merged:
        for name in names:
            if high > page.first and left <= columns.index(name) + 1 <= right:
                raise InputError(
                    f"{path.name}: the cells {text} of '{name}' are merged, and only the first of them holds "
                    "a value; unmerge them and fill every row"
                )


def _hidden_rows(page: Page) -> list[str]:
    """Say that rows count which a filter hides from the person who looks at the sheet."""
    if not page.hidden:
        return []
    if page.hidden == 1:
        return ["1 hidden row of the sheet counts too; delete it where it should not"]
    return [f"{page.hidden} hidden rows of the sheet count too; delete them where they should not"]


def _dates_beside(page: Page, columns: list[str], body: Rows, names: list[str]) -> list[str]:
    """Say it where a few cells of a column are dates: spreadsheets make dates of text like 1-5."""
    said = []
    for name in names:
        given = [(i, row[columns.index(name)]) for i, row in enumerate(body)]
        dates = [(i, value) for i, value in given if isinstance(value, date)]
        if dates and len(dates) < sum(value is not None for _, value in given):
            i, value = dates[0]
            example = f"{value.isoformat()[:10]} in row {page.first + 1 + i}"
            said.append(
                f"'{name}' holds dates among other values ({example}); "
                "spreadsheets make dates of text like 1-5 or 3.4"
            )
    return said


def _page(path: Path, sheet: str | None, formulas: bool = False) -> tuple[str, Page]:
    """Title and page of the sheet named, or of the only one that holds anything."""
    pages = _pages(path, path.stat().st_mtime_ns, formulas)
    if sheet is not None:
        if sheet not in pages:
            raise InputError(f"{path.name} has no sheet '{sheet}'{did_you_mean(sheet, pages)}")
        return sheet, pages[sheet]
    filled = [title for title, page in pages.items() if page.rows]
    if len(filled) > 1:
        raise InputError(
            f"{path.name} has {len(filled)} sheets with cells ({', '.join(filled)}); name one: "
            f"'{path.name}#{filled[0]}'"
        )
    title = filled[0] if filled else next(iter(pages))
    return title, pages[title]


@lru_cache(maxsize=2)
def _pages(path: Path, _changed: int, formulas: bool) -> dict[str, Page]:
    """Every sheet; read once for the header and for the cells."""
    from openpyxl import load_workbook

    refuse_too_large(path)
    try:
        # opened here: openpyxl leaves a damaged file open that it opened itself
        with path.open("rb") as file:
            book = load_workbook(file, data_only=not formulas)
            return {sheet.title: _page_of(path, sheet) for sheet in book.worksheets}
    except InputError:
        raise
    except _UNREADABLE as error:
        said = " ".join(str(error).split())
        raise InputError(
            f"{path.name} is not an Excel workbook that can be read ({said}); save it as .xlsx again or as "
            "CSV"
        ) from error


def _page_of(path: Path, sheet: Any) -> Page:
    refuse_too_far(path, sheet)
    furthest = sheet.max_row
    if furthest > LAST_ROW:
        raise ValueError(f"expected at most {LAST_ROW:,} rows, and there is a row {furthest:,}")
    last = _last_filled_row(sheet)
    # openpyxl takes a last row of 0 for all rows
    rows = [list(row) for row in sheet.iter_rows(max_row=last, values_only=True)] if last else []
    first = next((i for i, row in enumerate(rows) if any(value is not None for value in row)), furthest)
    merged = tuple(
        (str(area), area.min_row, area.min_col, area.max_row, area.max_col)
        for area in sheet.merged_cells.ranges
    )
    hidden = sum(
        number <= len(rows) and any(value is not None for value in rows[number - 1])
        for number, row in sheet.row_dimensions.items()
        if row.hidden and number > first + 1
    )
    return Page(rows[first:], first + 1, merged, hidden, furthest > last)


def _last_filled_row(sheet: Any) -> int:
    """The last row with a value, 0 where none has one.

    openpyxl's own iteration makes every cell up to the last that is formatted: a million rows of nothing.
    """
    return max((row for (row, _), cell in sheet._cells.items() if cell.value is not None), default=0)


def _refuse_uncalculated(path: Path, title: str, columns: list[str], body: Rows, names: list[str]) -> None:
    positions = [columns.index(name) for name in names]
    empty = [(i, p) for i, row in enumerate(body) for p in positions if row[p] is None]
    if not empty and not _page(path, title)[1].more:
        return
    page = _page(path, title, formulas=True)[1]
    formulas = page.rows[1:]
    # rows without any value end the body; formulas that were never calculated may be in them
    empty += [(i, p) for i in range(len(body), len(formulas)) for p in positions]
    for i, p in empty:
        held = formulas[i][p] if i < len(formulas) and p < len(formulas[i]) else None
        if isinstance(held, str) and held.startswith("="):
            raise InputError(
                f"{path.name}: row {page.first + 1 + i} of '{columns[p]}' holds the formula {held} "
                "without its value. Open the file in a spreadsheet program and save it, or save it as CSV"
            )
