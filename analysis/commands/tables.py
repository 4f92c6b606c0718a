"""`analysis convert` and `analysis reshape`."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError

# `analysis convert`: a CSV whose columns are declared, as SPSS or Parquet.


def register_convert(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="convert")(convert)


def convert(
    table: Annotated[Path, typer.Argument(help="CSV of a study from `server export`.")],
    columns: Annotated[
        Path, typer.Option(help="JSON description of its columns: `server export --format columns`.")
    ],
    out: Annotated[Path, typer.Option(help="File to write: .sav (SPSS) or .parquet.")],
) -> None:
    """Convert a study's CSV to SPSS or Parquet, with variable and value labels.

    `server export STUDY --format spss` does both steps at once.

    Example:

      analysis convert exp3.csv --columns exp3-columns.json --out exp3.sav
    """
    if out.suffix not in (".sav", ".parquet"):
        raise InputError(f"{out}: expected a name ending in .sav or .parquet")
    if not table.is_file():
        raise InputError(f"{table}: no such file; expected a CSV of `server export`")
    from analysis.convert import read_columns, read_typed, write_parquet, write_spss
    from experiments.files import whole_file

    declared = read_columns(columns)
    frame = read_typed(table, declared)
    with whole_file(out) as unfinished:
        (write_spss if out.suffix == ".sav" else write_parquet)(frame, declared, unfinished)
    typer.echo(f"{out}: {len(frame)} rows, {len(declared)} columns")


# `analysis reshape`: a wide table made long.


def register_reshape(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(name="reshape")(reshape)


def reshape(
    file: Annotated[Path, typer.Argument(help="CSV, Excel or SPSS file, one row per person.")],
    columns: Annotated[
        str,
        typer.Option(
            help="Pattern of the rating columns' names, with each factor in braces: '{face}_{blur}'."
        ),
    ],
    out: Annotated[Path, typer.Option(help="CSV file to write.")],
    rating: Annotated[str, typer.Option(help="Name of the column of ratings in the new file.")] = "rating",
) -> None:
    """Make a wide table long: one row per person and cell, as the other commands expect.

    Examples:

      analysis reshape wide.xlsx --columns '{face}_{blur}' --out long.csv

      analysis reshape wide.csv --columns 't{time}' --rating score --out long.csv
    """
    from analysis.read.wide import lengthen
    from experiments.files import check_targets, whole_file
    from table_files.formulas import guarded_cell, guarded_row

    check_targets([out])
    table = lengthen(file, columns, rating)
    with whole_file(out) as temporary:
        rows = table.rows.rename(columns=guarded_cell).apply(guarded_row)
        rows.to_csv(temporary, index=False, encoding="utf-8", lineterminator="\n")
    for decision in table.decisions:
        typer.echo(f"- {decision}")
    for factor in table.factors:
        typer.echo(f"- {factor}: {', '.join(dict.fromkeys(table.rows[factor]))}")
    typer.echo(
        f"- {table.n_columns} columns became '{rating}'; unchanged columns: "
        f"{', '.join(table.beside) or 'none'}"
    )
    typer.echo(f"written: {out} ({len(table.rows)} rows)")
