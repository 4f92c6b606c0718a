"""`server methods`: the Methods paragraph of a study."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from experiments.errors import InputError
from server.accounts.identity import OPERATOR
from server.cli_common import stored_services
from server.methods import service
from server.studies.lookup import find_study


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


def register(parent: typer.Typer) -> None:
    """Add `server methods` to the command line."""
    parent.command("methods")(methods)


def methods(
    study: Annotated[str, typer.Argument(help="Name of the study.")],
    form: Annotated[Form, typer.Option("--format", help="text, latex, or json for programs.")] = Form.TEXT,
    origin: Annotated[Origin, typer.Option(help="Whose runs are counted.")] = Origin.PARTICIPANT,
    series: Annotated[int | None, typer.Option(help="Data series; that of the version in use.")] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Folder of `analysis run --out`, for what each declared rule left out."),
    ] = None,
) -> None:
    """Write a study's Methods paragraph; each number is followed by the query that gives it.

    Examples:

      server methods exp3

      server methods exp3 --format latex --report exp3-report > methods.tex
    """
    results = service.read_results(report) if report else None
    if report and results is None:
        raise InputError(
            f"expected {service.RESULTS} in {report}, found none; run `analysis run --out` first"
        )
    with stored_services() as services, services.database.read() as session:
        methods = service.methods_of(
            session, find_study(session, study, OPERATOR, "view"), origin.value, series, results
        )
    written = {Form.TEXT: methods.text, Form.LATEX: methods.latex, Form.JSON: methods.json}[form]()
    typer.echo(written, nl=False)
