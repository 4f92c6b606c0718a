"""`analysis columns`, `convert` and `reshape`, and `page`: tables before and after an analysis."""

import json as json_module
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from analysis.commands.output import (
    SHOWN,
    JsonOption,
    ShownResult,
    names_in,
    save_json,
    save_page,
    show_tables,
    show_text,
)
from experiments.errors import InputError
from table_files import counted

MAX_LISTED = 20
"""Columns of a table that `analysis columns` describes, whether or not they have a role."""

# `analysis convert`: a CSV whose columns are declared, as SPSS or Parquet.


def register(app: typer.Typer) -> None:
    """Add the commands to `app`."""
    app.command(name="convert")(convert)
    app.command(name="reshape")(reshape)
    app.command(name="columns")(columns)
    app.command(name="page", hidden=True)(page)


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
    typer.echo(f"{out}: {counted(len(frame), 'row')}, {counted(len(declared), 'column')}")


# `analysis reshape`: a wide table made long.


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
    keep: Annotated[
        str,
        typer.Option(help="Columns that stay as they are although the pattern fits, separated by commas."),
    ] = "",
) -> None:
    """Make a wide table long: one row per person and cell, as the other commands expect.

    Examples:

      analysis reshape wide.xlsx --columns '{face}_{blur}' --out long.csv

      analysis reshape wide.csv --columns 't{time}' --rating score --out long.csv

      analysis reshape wide.csv --columns '{condition}' --keep id,age --out long.csv
    """
    from analysis.read.wide import lengthen
    from experiments.files import check_targets, whole_file
    from table_files.formulas import guarded_cell, guarded_row

    check_targets([out])
    table = lengthen(file, columns, rating, names_in(keep))
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
    typer.echo(f"written: {out} ({counted(len(table.rows), 'row')})")


# `analysis columns`: what a table may be, and the command that fits it.


def columns(
    file: Annotated[Path, typer.Argument(help="CSV, Excel, SPSS or JSON file, or a folder of CSV files.")],
    json: JsonOption = None,
) -> None:
    """Show what the columns of a table hold, and suggest the command that fits.

    Example:

      analysis columns ratings.csv
    """
    from analysis.read.column_roles import ONE_FACTOR, OPTIONS, SEVERAL, guess_roles, said_of_values
    from analysis.report.formats import Table

    guess = guess_roles(file)
    shown = guess.command_line(str(file)) if guess.command else ""
    commands = {
        name: {"needed": needed, "optional": optional} for name, (needed, optional) in OPTIONS.items()
    }
    several = {"roles": SEVERAL, "not_in": ONE_FACTOR}
    save_json(json, {**asdict(guess), "command_line": shown, "commands": commands, "several": several})
    for decision in guess.decisions:
        typer.echo(f"- {decision}")
    # Exports have dozens of columns: the analysis takes part in few.
    listed = [one for one in guess.columns if one.role or len(guess.columns) <= MAX_LISTED]
    rows = tuple((one.name, said_of_values(one), one.role or "-") for one in listed)
    title = f"{file.name}: {counted(guess.n_rows, 'row')}, {counted(len(guess.columns), 'column')}"
    show_tables(Table("columns", title, ("Column", "Values", "Role"), rows, 3))
    if others := [one.name for one in guess.columns if one not in listed]:
        show_text(f"No role: {', '.join(others)}")
    typer.echo(f"\n{shown}" if shown else "\nNo analysis fits these names. See analysis --help.")


def page(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="The table.")],
    folder: Annotated[Path, typer.Argument(help="Folder to write page.json and the figures to.")],
    roles: Annotated[Path, typer.Option(help="JSON file: the command, and the role of each column.")],
) -> None:
    """Run the command that a JSON file names, and write what it shows for a page of the admin site.

    Example:

      analysis page ratings.csv results --roles roles.json
    """
    from analysis.read.column_roles import options_of, shown_command

    asked = json_module.loads(roles.read_text(encoding="utf-8"))
    command, shown_name = asked["command"], asked.get("name", file.name)
    options = options_of(command, asked["roles"])
    more = ["--means"] if command in ("mixed", "ordinal") else []
    collected = ShownResult()
    SHOWN.set(collected)
    program: Any = context.find_root().command
    program.main([command, str(file), *options, *more], standalone_mode=False)
    save_page(collected, folder, shown_command(command, shown_name, [*options, *more]))
