"""`server doctor`, `server backup`, `server restore` and `server database copy`."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table

from server.cli_common import migrated_services, out
from server.clock import now
from server.context import open_services
from server.operations import backup as backups
from server.operations import restore as restoring
from server.operations.copying import address, copy_database
from server.operations.doctor import examine
from server.operations.retention import superfluous
from server.operations.rows import Content
from server.settings import Settings

MARKS = {"ok": "[green]ok[/]", "warning": "[yellow]warning[/]", "failed": "[red]failed[/]"}


def register(parent: typer.Typer) -> None:
    """Add the commands of whoever operates the server."""
    parent.command("doctor")(doctor)
    parent.command("backup")(backup)
    parent.command("restore")(restore)


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Check the installation and say what to fix; exit code 1 where something failed.

    Nothing is changed. The keys of --json: a list of objects with subject, verdict (ok, warning, failed),
    found, advice.
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
            table.add_row(MARKS[finding.verdict], finding.subject, finding.found, finding.advice)
        out.print(table)
    if any(finding.verdict == "failed" for finding in findings):
        raise typer.Exit(1)


def backup(
    file: Annotated[
        Path | None, typer.Argument(help="The file to write; palpebra-DATE.tar where not given.")
    ] = None,
    without_clips: Annotated[
        bool,
        typer.Option(
            "--without-clips", help="Leave the clips out, where their store is backed up by itself."
        ),
    ] = False,
    keep: Annotated[
        int,
        typer.Option(
            min=0,
            help="Keep, of the newest DAYS days with a backup, the last one each (all of the newest day); "
            "remove earlier palpebra-DATE.tar of that folder. 0: remove none.",
            metavar="DAYS",
        ),
    ] = 0,
) -> None:
    """Write database, clips and secret key of this moment into one file, while the server goes on.

    The file holds everybody's answers and the secret key: keep it where only you can read it (mode 600).
    Example: server backup backups/palpebra-$(date -u +%FT%H%M%S).tar --keep 14
    """
    path = file or Path(f"palpebra-{now():%Y-%m-%dT%H%M%S}.tar")
    with migrated_services() as services:
        described = backups.back_up(services, path, with_clips=not without_clips)
    rows = sum(table.rows for table in described.tables.values())
    out.print(f"{path}: {rows} rows, {len(described.clips)} clips, {path.stat().st_size / 1e6:.1f} MB")
    for old in superfluous(path.parent.glob("palpebra-*.tar"), keep) if keep else ():
        old.unlink()
        out.print(f"removed {old}")


def restore(
    file: Annotated[Path, typer.Argument(help="A file that `server backup` wrote.", show_default=False)],
) -> None:
    """Bring a backup back into an empty database (SQLite or PostgreSQL) and clip store.

    The database of the settings must be empty; stop the server first. Counts and hashes are compared.
    Example: DATABASE_URL=postgresql://me@host/new server restore backups/monday.tar
    """
    services = open_services(Settings())
    try:
        described = restoring.restore(services, file, out.print)
    finally:
        services.database.close()
    out.print(f"restored what was backed up on {described.created_at}")


def copy(
    source: Annotated[str, typer.Argument(help="Address to copy from.", show_default=False)],
    target: Annotated[str, typer.Argument(help="Address of an empty database.", show_default=False)],
) -> None:
    """Copy every row from one database to another and compare counts and hashes.

    Stop the server first: what is rated meanwhile would stay behind. Clips and the secret key stay where they
    are. Where anything differs nothing is kept in the target.
    Example: server database copy sqlite:///data/palpebra.sqlite postgresql://me@host/palpebra
    """

    def told(name: str, content: Content) -> None:
        out.print(f"{name}: {content.rows} rows, {content.sha256[:12]} in both")

    copied = copy_database(source, target, told)
    rows = sum(content.rows for content in copied.values())
    out.print(f"{rows} rows in {len(copied)} tables; now set DATABASE_URL to {address(target)}")
