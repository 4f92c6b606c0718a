"""`analysis convert`: a CSV whose columns are declared, as SPSS or Parquet."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="convert")(convert)


def convert(
    table: Annotated[Path, typer.Argument(help="CSV of a study, as `server export` writes it.")],
    columns: Annotated[Path, typer.Option(help="Its columns as JSON: `server export --format columns`.")],
    out: Annotated[Path, typer.Option(help="File to write: .sav (SPSS) or .parquet.")],
) -> None:
    """Write a study's CSV as SPSS or Parquet, with labels of variables and levels.

    `server export STUDY --format spss` does both steps at once.

    Example:

      analysis convert exp3.csv --columns exp3-columns.json --out exp3.sav
    """
    if out.suffix not in (".sav", ".parquet"):
        raise InputError(f"{out}: expected a name ending in .sav or .parquet")
    if not table.is_file():
        raise InputError(f"{table}: no such file; expected a CSV of `server export`")
    from analysis.convert.parquet import write_parquet
    from analysis.convert.spss import write_spss
    from analysis.convert.typed import read_columns, read_typed
    from experiments.files import whole_file

    declared = read_columns(columns)
    frame = read_typed(table, declared)
    with whole_file(out) as unfinished:
        (write_spss if out.suffix == ".sav" else write_parquet)(frame, declared, unfinished)
    typer.echo(f"{out}: {len(frame)} rows, {len(declared)} columns")
