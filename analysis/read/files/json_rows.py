"""JSON as programs for experiments write it: a list of objects, one a trial; or lines of such JSON."""

import json
from pathlib import Path
from typing import Any

from analysis.read.files.cells import Cells, cells_of
from experiments.errors import InputError

LARGEST = 2**63 - 1


def header(path: Path) -> list[str]:
    """Keys of all objects, in the order of their first appearance."""
    return list(dict.fromkeys(key for row in _objects(path) for key in row))


def cells(path: Path, names: list[str]) -> Cells:
    """The keys `names` of each object; values that are lists or objects stay JSON. Lines count objects."""
    objects = _objects(path)
    keys = list(dict.fromkeys(key for row in objects for key in row))
    return cells_of(keys, [[_plain(row.get(key)) for key in keys] for row in objects], names, 1)


def _objects(path: Path) -> list[dict[str, Any]]:
    try:
        read = _json_of(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # of digits too: Python reads 4,300 of a whole number
        said = str(error).partition(";")[0]
        raise InputError(f"{path.name} is not JSON that can be read ({said})") from error
    if isinstance(read, dict) and isinstance(read.get("trials"), list):
        read = read["trials"]
    elif isinstance(read, dict) and path.suffix.lower() != ".json":
        read = [read]  # lines of JSON, of which there is one
    rows = read if isinstance(read, list) else []
    if not rows or not all(isinstance(row, dict) for row in rows):
        raise InputError(f"{path.name}: expected a list of objects, one a trial; save the data as CSV")
    return rows


def _json_of(text: str) -> Any:
    """The value of a text; of JSON lines (an object each, or a list of them as of JATOS) all objects."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
    # splitlines would cut at U+2028 and U+0085 too, which may stand in the texts of JSON
    values = [json.loads(line) for line in text.split("\n") if line.strip()]
    return [row for value in values for row in (value if isinstance(value, list) else [value])]


def _plain(value: Any) -> Any:
    """As a cell holds it: lists and objects as JSON, whole numbers that no table has as their digits."""
    if isinstance(value, int) and abs(value) > LARGEST:
        return str(value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value
