"""SPSS files (.sav): values as codes, with the words for them beside."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from analysis.read.files.cells import Cells, cells_of
from experiments.errors import InputError

SPARE_S, BYTES_A_SECOND = 120, 500_000
"""Time for any file, and for its bytes: what takes longer goes in circles in damaged ones."""


def header(path: Path) -> list[str]:
    """Names of the variables."""
    return list(_read(path, [])["names"])


def cells(path: Path, names: list[str]) -> Cells:
    """The variables `names`; what is declared missing becomes empty."""
    told = _read(path, names)
    columns = told["columns"]
    rows = [list(row) for row in zip(*(columns[name] for name in names), strict=True)]
    read = cells_of(names, rows, names, 1)
    labels = {name: dict(pairs) for name, pairs in told["labels"].items()}
    return Cells(read.rows, tuple(told["names"]), read.lines, labels=labels, numeric=read.numeric)


# Decision 0815: Files that crash their reader end in one line.
def _read(path: Path, names: list[str]) -> dict[str, Any]:
    """What `spss_reader` tells of a file, in a process of its own, which damaged files may kill."""
    searched = {**os.environ, "PYTHONPATH": os.pathsep.join(folder for folder in sys.path if folder)}
    try:
        done = subprocess.run(  # noqa: S603 - this Python, a module of our own
            [sys.executable, "-P", "-m", "analysis.read.files.spss_reader", str(path.resolve())],
            input=json.dumps(names).encode(),
            capture_output=True,
            timeout=SPARE_S + path.stat().st_size / BYTES_A_SECOND,
            check=False,
            env=searched,
        )
        told: dict[str, Any] = json.loads(done.stdout) if done.returncode == 0 else {"refused": _DIED}
    except (subprocess.TimeoutExpired, ValueError):
        told = {"refused": _DIED}
    if "refused" in told:
        raise InputError(
            f"{path.name} is not an SPSS file that can be read ({told['refused']}); open it in SPSS or PSPP "
            "and save it anew, or export it as CSV"
        )
    if not told["names"]:
        raise InputError(f"{path.name} has no variables")
    return told


_DIED = "it is damaged: reading it ended the reader"
