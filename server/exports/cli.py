"""`server export`, `server capsule`, `server seal` and `server methods`."""

import json
import sys
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.text import Text
from sqlalchemy.exc import SQLAlchemyError

from experiments.errors import InputError, counted
from experiments.files import check_targets, whole_file, whole_text
from server.accounts.audit import record
from server.accounts.identity import OPERATOR
from server.cli_common import out, stored_services
from server.core.values import encode_text
from server.exports.capsules import CapsuleContents, CapsuleOrigin, build_capsule
from server.exports.formats import CSV_FORMATS, FORMATS, Format, row_count, spreadsheet_pieces
from server.exports.psych_ds import LANGUAGES, script
from server.exports.repository import runs_by_origin
from server.exports.schemas import ExportOrigin, Extract
from server.exports.seals import page, seal_of, seal_plan
from server.models import StudyVersion
from server.results import methods as methods_service
from server.studies.lookup import definition_of, find_study
from server.studies.series import definition_of_series, version_of_series

# `server export`: take the data of a study out, in the same forms as the dashboard's data page.


def register(parent: typer.Typer) -> None:
    """Add `server export`, `server capsule`, `server seal` and `server methods` to the command line."""
    _register_export(parent)
    _register_capsule(parent)
    _register_seal(parent)
    _register_methods(parent)


def _register_export(parent: typer.Typer) -> None:
    """Add `server export` to the command line."""
    parent.command("export")(export)


def export(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[Path, typer.Option("--out", help="File to write, or - for standard output.")],
    form: Annotated[
        Format,
        typer.Option(
            "--format",
            help=(
                "csv: one row per presentation; wide: one row per visit and one column per cell; runs: "
                "one row per visit with its form answers; spss, parquet: the table of csv; spss-wide, "
                "parquet-wide: the table of wide; raw: JSON lines with every drawn frame; codebook: "
                "Markdown; columns: the columns of csv as JSON; psych-ds: a zip of the de-identified "
                "dataset folder; identities: recruiters' IDs with the pseudonyms, recorded in the audit "
                "log."
            ),
        ),
    ] = "csv",
    origin: Annotated[
        ExportOrigin, typer.Option(help="Data of one origin, or all together.")
    ] = "participant",
    series: Annotated[
        int | None,
        typer.Option(min=1, help="Export one data series; by default all, distinguished by a column."),
    ] = None,
    bom: Annotated[
        bool, typer.Option("--bom", help="Begin a CSV with a byte order mark, so that Excel detects UTF-8.")
    ] = False,
    guard: Annotated[
        bool,
        typer.Option(
            "--guard/--no-guard",
            help="Put ' before each cell of a CSV that a spreadsheet would run as a formula (= + - @, not "
            "numbers). --no-guard writes every text exactly as given; use it only for programs.",
        ),
    ] = True,
    old_order: Annotated[
        bool,
        typer.Option(
            "--old-order",
            help=("Use the column order of version 0.1; by default, columns are in logical order."),
        ),
    ] = False,
    scripts: Annotated[
        bool,
        typer.Option(help="In addition to the long CSV, write scripts that analyze it with R and Python."),
    ] = True,
) -> None:
    """Export a study's data, for example as CSV with one column per factor.

    Participants have the study's pseudonyms. The file appears under its name only when complete. Next to a
    CSV with one row per play there are a script for R (afex, emmeans, lme4) and one for Python (pandas,
    statsmodels).

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
        extract = Extract(origin, series, old_order)
        definition_of_series(session, known, extract.series)
        if form != "codebook":
            action = "identities downloaded" if form == "identities" else "data downloaded"
            with services.database.write() as noted:
                record(noted, None, action, "study", study, what=form, origin=origin)
        try:
            size = _write(
                out_file, spreadsheet_pieces(FORMATS[form](session, known, extract), form, bom, guard)
            )
            if form == "csv" and scripts and str(out_file) != "-":
                beside = _write_scripts(out_file, version_of_series(session, known, extract.series))
        except InputError:
            # It says by itself what is wrong and what to do, such as a wide table of paired comparisons.
            raise
        except (ValueError, SQLAlchemyError) as error:
            raise InputError(
                f"the export failed ({str(error).splitlines()[0]}) and was discarded; run: server doctor"
            ) from error
        there = runs_by_origin(session, known)
        rows = None if form == "codebook" else row_count(form, session, known, extract)
    if str(out_file) != "-":
        counted = "" if rows is None else f"{rows:,} row{'' if rows == 1 else 's'}, "
        out.print(f"{out_file}: {counted}{size:,} bytes" + (f"; analyze it with {beside}" if beside else ""))
        if form == "psych-ds":
            out.print(
                f"the dataset is the folder {study}/ in the zip; to validate it, unpack the zip and check "
                f"this folder"
            )
    others = {name: number for name, number in sorted(there.items()) if name != origin}
    if rows == 0 and form != "identities" and origin != "all" and others:
        named = ", ".join(f"{number} of origin {name}" for name, number in others.items())
        typer.echo(f"no data of origin {origin} to export; there are runs: {named} (--origin)", err=True)


def _write_scripts(out_file: Path, version: StudyVersion) -> str:
    """Write the scripts next to the CSV; return their names in words."""
    targets = {language: out_file.with_suffix(f".{language}") for language in LANGUAGES}
    for language, target in targets.items():
        text = script(definition_of(version), language, out_file.name, series=version.series)
        _write(target, [encode_text(text)])
    return " or ".join(target.name for target in targets.values())


def _write(out_file: Path, pieces: Iterable[bytes]) -> int:
    """Write the pieces, to a file that gets its name at the end; return their bytes."""
    if str(out_file) == "-":
        return sum(sys.stdout.buffer.write(piece) for piece in pieces)
    with whole_file(out_file) as unfinished, unfinished.open("wb") as stream:
        return sum(stream.write(piece) for piece in pieces)


# `server capsule`: everything of a study that can be handed on, in one zip that can be verified.


def _register_capsule(parent: typer.Typer) -> None:
    """Add `server capsule` to the command line."""
    parent.command("capsule")(capsule)


def capsule(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[Path, typer.Option("--out", help="Zip to write.")],
    origin: Annotated[CapsuleOrigin, typer.Option(help="Whose data.")] = "participant",
    series: Annotated[
        int | None,
        typer.Option(
            min=1,
            help=(
                "Include only one data series: its data, definition, clips and report. By default, the "
                "data of every series, and everything else of the active version."
            ),
        ),
    ] = None,
    clips: Annotated[
        bool, typer.Option(help="Include the clips; otherwise only the manifest with their hashes.")
    ] = True,
    sensitivity: Annotated[
        bool, typer.Option(help="Include slow analyses: mixed and ordinal models, Bayes factors.")
    ] = True,
) -> None:
    """Write the capsule of a study: a Psych-DS dataset and an RO-Crate with data, materials and report.

    The data are de-identified. Anybody can verify the capsule with `analysis verify`.

    Examples:

      server capsule exp3 --out exp3-capsule.zip

      server capsule exp3 --origin simulated --no-clips --out rehearsal.zip

      server capsule exp3 --series 2 --out exp3-series-2.zip

      analysis verify exp3-capsule.zip
    """
    check_targets([out_file])
    with stored_services() as services, Console(stderr=True, markup=False).status("capsule") as status:
        with services.database.write() as session:
            known = find_study(session, study, OPERATOR, "view")
            about = definition_of_series(session, known, series).dataset
            record(session, None, "data downloaded", "study", study, what="capsule", origin=origin)
        made = build_capsule(
            services.database,
            services.clips,
            study,
            CapsuleContents(origin, clips, sensitivity, series),
            out_file,
            lambda _, step: status.update(Text(f"capsule: {step}")),
        )
    files = counted(len(made.files), "file")
    out.print(f"{out_file}: {out_file.stat().st_size:,} bytes, {files}, sha256 {made.sha256}")
    missing = [
        name for name, value in (("creators", about.creators), ("licence", about.licence)) if not value
    ]
    if missing:
        typer.echo(f"no {' and no '.join(missing)} declared; add them to the table [dataset]", err=True)


# `server seal`: fix the plan of a study before its first participant.


def _register_seal(parent: typer.Typer) -> None:
    """Add `server seal` to the command line."""
    parent.command("seal")(seal)


def seal(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    out_file: Annotated[
        Path, typer.Option("--out", help="JSON file to write; a printable page is written next to it.")
    ],
    power: Annotated[
        Path | None, typer.Option(help="JSON of `analysis power --json`, to seal with the plan.")
    ] = None,
) -> None:
    """Seal design, exclusions, analysis plan and power before the first participant, or write the seal again.

    Examples:

      server seal exp3 --out exp3-seal.json

      analysis run exp3.toml --csv exp3.csv --seal exp3-seal.json
    """
    planned = _power(power)
    with stored_services() as services, services.database.write() as session:
        known = find_study(session, study, OPERATOR, "view")
        sealed = seal_of(session, known) or seal_plan(session, known, None, planned)
    if planned is not None and sealed.power != planned:
        raise InputError(
            f"the plan was sealed {sealed.sealed_at} with a different power; a seal cannot be replaced"
        )
    for path, text in ((out_file, sealed.text()), (out_file.with_suffix(".html"), page(sealed))):
        with whole_text(path) as stream:
            stream.write(text)
    out.print(f"{out_file}: sealed {sealed.sealed_at}, sha256 {sealed.sha256}")


def _power(path: Path | None) -> dict[str, Any] | None:
    if path is None:
        return None
    try:
        power = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: expected the JSON of `analysis power` ({error})") from error
    if not isinstance(power, dict):
        raise InputError(f"{path}: expected the JSON of `analysis power`, got a list or a number")
    return power


# `server methods`: the Methods paragraph of a study.


class Form(StrEnum):
    """Forms of the paragraph."""

    TEXT = "text"
    LATEX = "latex"
    JSON = "json"


class Origin(StrEnum):
    """Whose runs are counted."""

    PARTICIPANT = "participant"
    PILOT = "pilot"
    SIMULATED = "simulated"


def _register_methods(parent: typer.Typer) -> None:
    """Add `server methods` to the command line."""
    parent.command("methods")(methods)


def methods(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    form: Annotated[Form, typer.Option("--format", help="text, latex, or json for programs.")] = Form.TEXT,
    origin: Annotated[Origin, typer.Option(help="Whose runs are counted.")] = Origin.PARTICIPANT,
    series: Annotated[
        int | None, typer.Option(help="Data series; by default, that of the current version.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Folder of `analysis run --out`, for the number of exclusions per declared rule."),
    ] = None,
) -> None:
    """Write a study's Methods paragraph with the query behind each number.

    Examples:

      server methods exp3

      server methods exp3 --format latex --report exp3-report > methods.tex
    """
    results = methods_service.read_results(report) if report else None
    if report and results is None:
        raise InputError(
            f"expected {methods_service.RESULTS} in {report}, found none; run `analysis run --out` first"
        )
    with stored_services() as services, services.database.read() as session:
        methods = methods_service.methods_of(
            session, find_study(session, study, OPERATOR, "view"), origin.value, series, results
        )
    written = {Form.TEXT: methods.text, Form.LATEX: methods.latex, Form.JSON: methods.json}[form]()
    typer.echo(written, nl=False)
