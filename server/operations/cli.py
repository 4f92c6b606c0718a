"""`server doctor` and `server database copy`."""

import json
from dataclasses import asdict
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from server.cli_common import out
from server.context import open_services
from server.operations.copying import address, copy_database
from server.operations.doctor import examine
from server.operations.rows import Content
from server.settings import Settings

FILE_WIDTH = 1_000
"""Characters: wider than any finding."""
COLORS = {"ok": "green", "warning": "yellow", "failed": "red"}


def register(parent: typer.Typer) -> None:
    """Add the commands of whoever operates the server."""
    parent.command("doctor")(doctor)


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Check the installation and say what to fix; exit code 1 where something failed.

    Nothing is changed. The keys of --json: a list of objects with subject, verdict (ok, warning, failed),
    state, advice.
    Example: server doctor
    """
    services = open_services(Settings())
    try:
        findings = examine(services)
    finally:
        services.database.close()
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        whole = (Column(name, overflow="fold") for name in ("found", "what to do"))
        table = Table("", "what", *whole, box=None, pad_edge=False)
        for finding in findings:
            table.add_row(
                Text(finding.verdict, COLORS[finding.verdict]), finding.subject, finding.state, finding.advice
            )
        # In a file or a pipe a path is whole on its line; a terminal's own width is for eyes.
        (out if out.is_terminal else Console(width=FILE_WIDTH, highlight=False, markup=False)).print(table)
    if any(finding.verdict == "failed" for finding in findings):
        raise typer.Exit(1)


def copy(
    source: Annotated[str, typer.Argument(help="Address to copy from.", show_default=False)],
    target: Annotated[str, typer.Argument(help="Address of an empty database.", show_default=False)],
) -> None:
    """Copy every row from one database to another and compare counts and hashes.

    Stop the server first: what is rated meanwhile would stay behind. Clips and the secret key stay where they
    are. Where anything differs nothing is kept in the target.
    Example: server database copy sqlite:///data/palpebra.sqlite postgresql://me@db/lab
    """

    def told(name: str, content: Content) -> None:
        out.print(f"{name}: {content.rows} rows, {content.sha256[:12]} in both")

    copied = copy_database(source, target, told)
    rows = sum(content.rows for content in copied.values())
    out.print(f"{rows} rows in {len(copied)} tables; now set DATABASE_URL to {address(target)}")
