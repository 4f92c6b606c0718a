"""`server export`: take the data of a study out, in the same forms as the dashboard's data page."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from sqlalchemy.exc import SQLAlchemyError

from experiments.definition import Experiment
from experiments.errors import InputError
from experiments.files import check_targets, whole_file
from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.export.extract import ExportOrigin, Extract
from server.export.formats import CSV_FORMATS, FORMATS, Format, row_count, spreadsheet_pieces
from server.export.repository import runs_by_origin
from server.export.scripts import LANGUAGES, script
from server.studies.lookup import find_study
from server.text import encoded


def register(parent: typer.Typer) -> None:
    """Add `server export` to the command line."""
    parent.command("export")(export)


def export(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[Path, typer.Option("--out", help="File to write, or - for the standard output.")],
    form: Annotated[
        Format,
        typer.Option(
            "--format",
            help="csv: one row a play; wide: one row a visit and a column a cell; runs: one row a visit with "
            "its answers to forms; spss, parquet: the table of csv; spss-wide, parquet-wide: that of wide; "
            "raw: JSON lines with every drawn frame; codebook: Markdown; columns: those of csv as JSON; "
            "psych-ds: a zip of the de-identified dataset folder; identities: recruiters' ids beside the "
            "pseudonyms, noted in the audit log.",
        ),
    ] = "csv",
    origin: Annotated[
        ExportOrigin, typer.Option(help="Whose data: of one origin, or all together.")
    ] = "participant",
    series: Annotated[
        int | None,
        typer.Option(min=1, help="Data of one data series; without it of all, told apart by a column."),
    ] = None,
    bom: Annotated[
        bool, typer.Option("--bom", help="Begin a CSV with a byte order mark, by which Excel knows UTF-8.")
    ] = False,
    guard: Annotated[
        bool,
        typer.Option(
            "--guard/--no-guard",
            help="Put ' before each cell of a CSV that a spreadsheet would run as a formula (= + - @, not "
            "numbers). --no-guard writes every text exactly as it was given: for programs alone.",
        ),
    ] = True,
    scripts: Annotated[
        bool, typer.Option(help="Beside the long CSV, write scripts that analyse it with R and Python.")
    ] = True,
) -> None:
    """Write a study's data: as csv, the columns of experiments/columns and one column a factor.

    Participants have the study's pseudonyms. The file appears under its name only when complete. Beside a CSV
    with one row a play stand a script for R (afex, emmeans, lme4) and one for Python (pandas, statsmodels).

    Examples:

      server export exp3 --out exp3.csv

      server export exp3 --format wide --bom --out exp3-wide.csv

      server export exp3 --format spss-wide --out exp3.sav

      server export exp3 --format psych-ds --out exp3.zip

      server export exp3 --origin simulated --out rehearsal.csv

      server export exp3 --series 2 --out exp3-series-2.csv
    """
    beside = ""
    if (bom or not guard) and form not in CSV_FORMATS:
        raise InputError(f"--bom and --no-guard are for CSV ({', '.join(CSV_FORMATS)}), not {form}")
    if str(out_file) != "-":
        check_targets([out_file])
    with stored_services() as services, services.database.snapshot() as session:
        known = find_study(session, study, OPERATOR, "view")
        extract = Extract(origin, series)
        extract.definition(session, known)
        if form != "codebook":
            action = "identities downloaded" if form == "identities" else "data downloaded"
            with services.database.write() as noted:
                record(noted, None, action, "study", study, what=form, origin=origin)
        try:
            size = _write(
                out_file, spreadsheet_pieces(FORMATS[form](session, known, extract), form, bom, guard)
            )
            if form == "csv" and scripts and str(out_file) != "-":
                beside = _write_scripts(out_file, extract.definition(session, known))
        except (ValueError, SQLAlchemyError) as error:
            raise InputError(
                f"the export broke off ({str(error).splitlines()[0]}) and was not kept; run: server doctor"
            ) from error
        there = runs_by_origin(session, known)
        rows = None if form == "codebook" else row_count(form, session, known, extract)
    if str(out_file) != "-":
        counted = "" if rows is None else f"{rows:,} row{'' if rows == 1 else 's'}, "
        out.print(f"{out_file}: {counted}{size:,} bytes" + (f"; analyse it with {beside}" if beside else ""))
        if form == "psych-ds":
            out.print(
                f"the dataset is the folder {study}/ in the zip: unpack it and give that to a validator"
            )
    others = {name: number for name, number in sorted(there.items()) if name != origin}
    if rows == 0 and form != "identities" and origin != "all" and others:
        named = ", ".join(f"{number} of origin {name}" for name, number in others.items())
        typer.echo(f"nothing of origin {origin} to export; there are runs: {named} (--origin)", err=True)


def _write_scripts(out_file: Path, experiment: Experiment) -> str:
    """Write the scripts beside the CSV; their names in words."""
    targets = {language: out_file.with_suffix(f".{language}") for language in LANGUAGES}
    for language, target in targets.items():
        _write(target, [encoded(script(experiment, language, out_file.name))])
    return " or ".join(target.name for target in targets.values())


def _write(out_file: Path, pieces: Iterable[bytes]) -> int:
    """Write the pieces, to a file that gets its name at the end; return their bytes."""
    if str(out_file) == "-":
        return sum(sys.stdout.buffer.write(piece) for piece in pieces)
    with whole_file(out_file) as unfinished, unfinished.open("wb") as stream:
        return sum(stream.write(piece) for piece in pieces)
