"""Excel workbooks (.xlsx): one sheet, its first row the header."""

from functools import lru_cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from analysis.read.files.cells import Cells, cells_of
from experiments.errors import InputError, did_you_mean

Rows = list[list[Any]]


def header(path: Path, sheet: str | None) -> list[str]:
    """Names of the columns of a sheet."""
    return _header(path, _rows(path, sheet)[1])


def cells(path: Path, sheet: str | None, names: list[str]) -> Cells:
    """The columns `names` of a sheet; a formula that Excel never calculated is refused, it has no value."""
    title, rows = _rows(path, sheet)
    columns = _header(path, rows)
    width = len(columns)
    body = [(row + [None] * width)[:width] for row in rows[1:]]
    _refuse_uncalculated(path, title, columns, body, names)
    return cells_of(columns, body, names, 2, decisions=(f"read from the sheet '{title}' of {path.name}",))


def _header(path: Path, rows: Rows) -> list[str]:
    names = ["" if value is None else str(value).strip() for value in rows[0]] if rows else []
    while names and not names[-1]:
        names.pop()
    if not names:
        raise InputError(f"{path.name} is empty; expected a header row and one row a trial")
    return names


def _rows(path: Path, sheet: str | None, formulas: bool = False) -> tuple[str, Rows]:
    """Title and rows of the sheet named, or of the only one that holds anything."""
    pages = _pages(path, path.stat().st_mtime_ns, formulas)
    if sheet is not None:
        if sheet not in pages:
            raise InputError(f"{path.name} has no sheet '{sheet}'{did_you_mean(sheet, pages)}")
        return sheet, pages[sheet]
    filled = [title for title, rows in pages.items() if any(any(v is not None for v in row) for row in rows)]
    if len(filled) > 1:
        raise InputError(
            f"{path.name} has {len(filled)} sheets with cells ({', '.join(filled)}); name one: "
            f"'{path.name}#{filled[0]}'"
        )
    title = filled[0] if filled else next(iter(pages))
    return title, pages[title]


@lru_cache(maxsize=2)
def _pages(path: Path, _changed: int, formulas: bool) -> dict[str, Rows]:
    """Rows of every sheet; read once for the header and for the cells."""
    from openpyxl import load_workbook
    from openpyxl.utils.exceptions import InvalidFileException

    try:
        book = load_workbook(path, data_only=not formulas)
    except (BadZipFile, InvalidFileException, KeyError, ValueError, OSError) as error:
        raise InputError(
            f"{path.name} is not an Excel workbook ({error}); save it as .xlsx or CSV"
        ) from error
    return {page.title: [list(row) for row in page.iter_rows(values_only=True)] for page in book.worksheets}


def _refuse_uncalculated(path: Path, title: str, columns: list[str], body: Rows, names: list[str]) -> None:
    positions = [columns.index(name) for name in names]
    empty = [(i, p) for i, row in enumerate(body) for p in positions if row[p] is None]
    if not empty:
        return
    formulas = _rows(path, title, formulas=True)[1][1:]
    for i, p in empty:
        held = formulas[i][p] if p < len(formulas[i]) else None
        if isinstance(held, str) and held.startswith("="):
            raise InputError(
                f"{path.name}: row {i + 2} of '{columns[p]}' holds the formula {held} without its value; "
                "open the file in a spreadsheet program and save it, or save it as CSV"
            )
