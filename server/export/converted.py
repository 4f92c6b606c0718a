"""Tables as SPSS or Parquet, written by the program `analysis`: the server carries no numerics."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from pydantic import TypeAdapter

from experiments.columns import Column
from experiments.errors import InputError
from server.export.pieces import csv_pieces
from server.export.tables import ExportTable

LONGEST_S = 1800
AT_ONCE = 2**20
Ending = Literal["sav", "parquet"]
_COLUMNS = TypeAdapter(list[Column])


def columns_json(columns: list[Column]) -> bytes:
    """The declarations of a table's columns, as `analysis convert` reads them."""
    return _COLUMNS.dump_json(columns, indent=1)


def converted(table: ExportTable, ending: Ending) -> Iterator[bytes]:
    """The pieces of the file; InputError, with the program's own line, where it cannot be made."""
    with TemporaryDirectory(prefix="export-") as temporary:
        folder = Path(temporary)
        write_table(table, folder)
        with convert(folder, ending).open("rb") as stream:
            while piece := stream.read(AT_ONCE):
                yield piece


def write_table(table: ExportTable, folder: Path) -> None:
    """Write the table and the declarations of its columns: all that a conversion needs of the database."""
    (folder / "columns.json").write_bytes(columns_json(table.columns))
    with (folder / "table.csv").open("wb") as stream:
        for piece in csv_pieces(table.with_header()):
            stream.write(piece)


def convert(folder: Path, ending: Ending) -> Path:
    """Convert what `write_table` wrote; InputError, with the program's own line, where it cannot be."""
    target = folder / f"table.{ending}"
    program = Path(sys.executable).with_name("analysis")
    command = [str(program), "convert", str(folder / "table.csv"), "--columns", str(folder / "columns.json")]
    done = subprocess.run(  # noqa: S603 - our own program
        [*command, "--out", str(target)], capture_output=True, text=True, timeout=LONGEST_S, check=False
    )
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        raise InputError(lines[-1][:500] if lines else f"analysis convert ended with code {done.returncode}")
    return target
