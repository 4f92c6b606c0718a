"""`server export`: take the ratings of a study out as a tidy CSV."""

import secrets
import sys
from pathlib import Path
from typing import Annotated

import typer

from server.cli_common import migrated_services, out
from server.export.ratings_csv import write_ratings_csv
from server.studies.lookup import find_study


def register(parent: typer.Typer) -> None:
    """Add `server export` to the command line."""
    parent.command("export")(export)


def export(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[Path, typer.Option("--out", help="CSV file to write, or - for the standard output.")],
) -> None:
    """Write one row a play: the columns of experiments/ratings.py, one column a factor.

    Memory stays constant however many rows there are; the file appears under its name only when complete.
    Example: server export exp3 --out exp3.csv
    """
    with migrated_services() as services, services.database.read() as session:
        found = find_study(session, study)
        if str(out_file) == "-":
            write_ratings_csv(session, found, sys.stdout)
            return
        out_file.parent.mkdir(parents=True, exist_ok=True)
        temporary = out_file.with_name(f".{out_file.name}.{secrets.token_hex(4)}")
        try:
            with temporary.open("w", encoding="utf-8", newline="") as stream:
                rows = write_ratings_csv(session, found, stream)
            temporary.replace(out_file)
        finally:
            temporary.unlink(missing_ok=True)
    out.print(f"{out_file}: {rows} rows")
