"""Open a table by what it is: the one place that knows all sorts of files."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from table_files import InputError
from table_files.cells import Cells, cells_of, text_cells
from table_files.delimited import NamedRows, delimited_table, text_of

_SAVE_AS = {
    ".xls": ".xlsx",
    ".ods": ".xlsx",
    ".numbers": ".xlsx",
    ".dta": "CSV",
    ".rds": "CSV",
    ".rdata": "CSV",
}
_WORKBOOKS = (".xlsx", ".xlsm")
_SPSS = (".sav", ".zsav")
_JSON = (".json", ".jsonl")
_HEAD = 1 << 12


class Reader(NamedTuple):
    """How the names of a file's columns are read, and the cells of some of them."""

    header: Callable[[], list[str]]
    cells: Callable[[list[str]], Cells]


def reader_of(path: Path) -> Reader:
    """The reader of a file; libraries that only one sort of file needs are imported with its reader.

    `book.xlsx#Sheet 2` names a sheet.

    Raises
    ------
    InputError
        No file, a folder, or a sort of file that is not read.
    """
    path, sheet = _split_sheet(path)
    refuse_unread(path)
    suffix = path.suffix.lower()
    if suffix in _WORKBOOKS:
        from table_files import workbook

        return Reader(lambda: workbook.header(path, sheet), lambda names: workbook.cells(path, sheet, names))
    if suffix in _SPSS:
        from table_files import spss

        return Reader(lambda: spss.header(path), lambda names: spss.cells(path, names))
    if suffix in _JSON or (suffix == ".txt" and _looks_like_json(path)):
        return Reader(lambda: _json_header(path), lambda names: _json_cells(path, names))
    return Reader(lambda: list(delimited_table(path).header), lambda names: delimited_cells(path, names))


def named_rows(path: Path) -> NamedRows:
    """A file of any sort as rows by the names of its columns; CSV without any library, a row at a time.

    Raises
    ------
    InputError
        As `reader_of`; where the rows are asked for, what is wrong with one.
    """
    if is_delimited(path):
        refuse_unread(path)
        return delimited_table(path).named_rows()
    reader = reader_of(path)
    header = reader.header()
    cells = reader.cells(header)
    rows = (dict(zip(header, row, strict=True)) for row in cells.rows.itertuples(index=False, name=None))
    return NamedRows(header, zip((int(line) for line in cells.lines), rows, strict=True))


def is_delimited(path: Path) -> bool:
    """Whether a file is read as CSV: anything but Excel, SPSS or JSON."""
    path, _ = _split_sheet(path)
    suffix = path.suffix.lower()
    other = suffix in (*_WORKBOOKS, *_SPSS, *_JSON)
    return not other and not (suffix == ".txt" and path.is_file() and _looks_like_json(path))


def refuse_unread(path: Path) -> None:
    """Refuse what is not a file, and sorts of files that are not read.

    Raises
    ------
    InputError
    """
    if path.is_dir():
        raise InputError(f"{path}: expected a CSV file, this is a folder; name a file in it")
    if not path.is_file():
        raise InputError(f"no file {path}; expected a table as CSV, Excel (.xlsx), SPSS (.sav) or JSON")
    suffix = path.suffix.lower()
    if suffix in _SAVE_AS:
        raise InputError(f"{path.name}: files of {suffix} are not read; save it as {_SAVE_AS[suffix]}")
    if path.stat().st_size == 0:
        raise InputError(f"{path.name} is empty; expected a table with a header line")


def delimited_cells(path: Path, names: list[str]) -> Cells:
    """The columns `names` of a CSV file; rows of unequal length are refused."""
    table = delimited_table(path)
    rows, lines = table.columns(names)
    return text_cells(rows, lines, names, table.header, table.notes)


def _split_sheet(path: Path) -> tuple[Path, str | None]:
    if path.exists() or "#" not in path.name:
        return path, None
    name, _, sheet = path.name.partition("#")
    return path.with_name(name), sheet


def _looks_like_json(path: Path) -> bool:
    """Whether a text begins as an object of JSON, or a list of some: JATOS saves its results as `.txt`."""
    with path.open("rb") as file:
        start = file.read(_HEAD).removeprefix(b"\xef\xbb\xbf")
    return re.match(rb'\s*(\{\s*["}]|\[\s*[\[{\]])', start) is not None


# JSON as programs for experiments write it: a list of objects, one per trial; or lines of such JSON.

_LARGEST = 2**63 - 1


def _json_header(path: Path) -> list[str]:
    """Keys of all objects, in the order of their first appearance."""
    return list(dict.fromkeys(key for row in _objects(path) for key in row))


def _json_cells(path: Path, names: list[str]) -> Cells:
    """The keys `names` of each object; values that are lists or objects stay JSON. Lines count objects."""
    objects = _objects(path)
    keys = list(dict.fromkeys(key for row in objects for key in row))
    return cells_of(keys, [[_plain(row.get(key)) for key in keys] for row in objects], names, 1)


def _objects(path: Path) -> list[dict[str, Any]]:
    text = text_of(path)
    try:
        read = _json_of(text)
    except (ValueError, RecursionError) as error:  # of digits too: Python reads 4,300 of a whole number
        said = str(error).partition(";")[0]
        raise InputError(f"{path.name} is not JSON that can be read ({said})") from error
    if isinstance(read, dict) and isinstance(read.get("trials"), list):
        read = read["trials"]
    elif isinstance(read, dict) and path.suffix.lower() != ".json":
        read = [read]  # lines of JSON, of which there is one
    rows = read if isinstance(read, list) else []
    if not rows or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{path.name}: expected a list of objects, one per trial; save the data as CSV")
    return rows


def _json_of(text: str) -> Any:
    """The value of a text; of JSON lines (an object each, or a list of them as of JATOS) all objects."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
    # splitlines would cut at U+2028 and U+0085 too, which may be in the texts of JSON
    values = [json.loads(line) for line in text.split("\n") if line.strip()]
    return [row for value in values for row in (value if isinstance(value, list) else [value])]


def _plain(value: Any) -> Any:
    """As a cell holds it: lists and objects as JSON, whole numbers that no table has as their digits."""
    if isinstance(value, int) and abs(value) > _LARGEST:
        return str(value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
