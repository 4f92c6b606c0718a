"""SPSS files (.sav): values as codes, with their labels."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from table_files import InputError
from table_files.cells import Cells, cell_text, cells_of

SPARE_S, BYTES_A_SECOND = 120, 500_000
"""Time for any file, and for its bytes: what takes longer goes in circles in damaged ones."""


def header(path: Path) -> list[str]:
    """Names of the variables."""
    return list(_read(path, [])["names"])


def cells(path: Path, names: list[str]) -> Cells:
    """The variables `names`; what is declared missing becomes empty."""
    report = _read(path, names)
    columns = report["columns"]
    rows = [list(row) for row in zip(*(columns[name] for name in names), strict=True)]
    read = cells_of(names, rows, names, 1)
    labels = {name: dict(pairs) for name, pairs in report["labels"].items()}
    return Cells(read.rows, tuple(report["names"]), read.lines, labels=labels, numeric=read.numeric)


# Decision 0815: Files that crash their reader end in one line.
def _read(path: Path, names: list[str]) -> dict[str, Any]:
    """What `main` reports of a file, in a separate process, because damaged files may kill it."""
    searched = {**os.environ, "PYTHONPATH": os.pathsep.join(folder for folder in sys.path if folder)}
    try:
        done = subprocess.run(  # noqa: S603 - this Python, a module of our own
            [sys.executable, "-P", "-m", "table_files.spss", str(path.resolve())],
            input=json.dumps(names).encode(),
            capture_output=True,
            timeout=SPARE_S + path.stat().st_size / BYTES_A_SECOND,
            check=False,
            env=searched,
        )
        report: dict[str, Any] = json.loads(done.stdout) if done.returncode == 0 else {"refused": _DIED}
    except (subprocess.TimeoutExpired, ValueError):
        report = {"refused": _DIED}
    if "refused" in report:
        raise InputError(
            f"{path.name} is not an SPSS file that can be read ({report['refused']}). Open it in SPSS or "
            "PSPP and save it again, or export it as CSV"
        )
    if not report["names"]:
        raise InputError(f"{path.name} has no variables")
    return report


_DIED = "it is damaged: reading it ended the reader"


# The process that opens an SPSS file: native code reads it, which damaged bytes may kill.
#
# python -m table_files.spss FILE
#
# takes names of variables as a JSON list on its standard input and prints JSON: `names` of all variables,
# `columns` and `labels` of those named, or `refused` with the reason.

SPARE_BYTES, BYTES_PER_BYTE = 4 << 30, 64
"""Memory for any file, and for each of its bytes: damaged lengths may ask for any amount."""


def main(path: Path) -> None:
    """Print what a file holds as JSON."""
    _bound_memory(path.stat().st_size)
    sys.stdout.write(json.dumps(_read_file(path, json.load(sys.stdin))))


def _bound_memory(size: int) -> None:
    try:
        import resource  # absent on Windows
    except ImportError:
        return
    limit = SPARE_BYTES + BYTES_PER_BYTE * size
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def _read_file(path: Path, names: list[str]) -> dict[str, Any]:
    import pyreadstat

    try:
        columns, about = pyreadstat.read_sav(path, metadataonly=not names, output_format="dict")
    except Exception as error:  # of damaged files pyreadstat raises whatever it stumbles over
        return {"refused": " ".join(str(error).split()) or type(error).__name__}
    if not all(about.column_names):
        return {"refused": "a variable has no name"}
    labels: Mapping[str, Mapping[Any, Any]] = about.variable_value_labels
    return {
        "names": list(about.column_names),
        "columns": {name: [_plain(value) for value in columns[name]] for name in names},
        "labels": {
            name: [[cell_text(code), str(word)] for code, word in _ordered(labels[name])]
            for name in names
            if name in labels
        },
    }


def _ordered(words: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """Codes with their words in the order of the codes, as SPSS lists them."""
    numbers = all(isinstance(code, int | float) for code in words)
    return sorted(words.items(), key=(lambda item: item[0]) if numbers else (lambda item: str(item[0])))


def _plain(value: Any) -> Any:
    """A number as it is; no value as null; anything else as its text."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if math.isfinite(value) else None
    return cell_text(value) or None


if __name__ == "__main__":
    main(Path(sys.argv[1]))
