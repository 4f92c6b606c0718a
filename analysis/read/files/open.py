"""Open a file by what it is: the one place that knows all of them."""

import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from analysis.read.files.cells import Cells
from analysis.read.files.delimited import delimited_cells, delimited_header
from experiments.errors import InputError

_SAVE_AS = {
    ".xls": ".xlsx",
    ".ods": ".xlsx",
    ".numbers": ".xlsx",
    ".dta": "CSV",
    ".rds": "CSV",
    ".rdata": "CSV",
}
_OF_SUFFIX = {
    ".xlsx": "workbook",
    ".xlsm": "workbook",
    ".sav": "spss",
    ".zsav": "spss",
    ".json": "json_rows",
    ".jsonl": "json_rows",
}

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
        No file, or a sort of file that is not read.
    """
    path, sheet = _split_sheet(path)
    sort = _sort(path)
    if sort == "delimited":
        return Reader(lambda: delimited_header(path)[0], lambda names: delimited_cells(path, names))
    module = import_module(f"analysis.read.files.{sort}")
    if sort == "workbook":
        return Reader(lambda: module.header(path, sheet), lambda names: module.cells(path, sheet, names))
    return Reader(lambda: module.header(path), lambda names: module.cells(path, names))


def _split_sheet(path: Path) -> tuple[Path, str | None]:
    if path.exists() or "#" not in path.name:
        return path, None
    name, _, sheet = path.name.partition("#")
    return path.with_name(name), sheet


def _sort(path: Path) -> str:
    if path.is_dir():
        return "folder"
    if not path.is_file():
        raise InputError(f"no file {path}; expected a CSV file with one row a trial")
    suffix = path.suffix.lower()
    if suffix in _SAVE_AS:
        raise InputError(f"{path.name}: files of {suffix} are not read; save it as {_SAVE_AS[suffix]}")
    if suffix == ".txt" and _looks_like_json(path):
        return "json_rows"
    return _OF_SUFFIX.get(suffix, "delimited")


def _looks_like_json(path: Path) -> bool:
    """Whether a text begins as an object of JSON, or a list of some: JATOS saves its results as `.txt`."""
    with path.open("rb") as file:
        start = file.read(_HEAD).removeprefix(b"\xef\xbb\xbf")
    return re.match(rb'\s*(\{\s*["}]|\[\s*[\[{\]])', start) is not None
