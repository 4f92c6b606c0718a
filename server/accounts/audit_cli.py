"""`server audit`: prove that the audit log is whole, and take it out."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from experiments.command_groups import command_group
from experiments.errors import InputError
from experiments.files import whole_file
from server.accounts import repository
from server.accounts.audit import export_line, verify
from server.cli_common import out, stored_services
from server.core.db import Database

app = command_group("The audit log: verify its chain of hashes, export it.")


def register(parent: typer.Typer) -> None:
    """Add `server audit` to the command line."""
    parent.add_typer(app, name="audit")


@app.command("verify")
def verify_chain(
    head: Annotated[
        str, typer.Option(help="POSITION:HASH kept from an earlier verification, export or syslog.")
    ] = "",
) -> None:
    """Go along the chain of hashes; exit code 2, and the first entry that does not fit, where it is broken.

    Keep the head it prints elsewhere: with --head the next verification sees whether entries were cut off.

    Examples:

      server audit verify

      server audit verify --head 412:9f2c...
    """
    kept = _head(head) if head else None
    with stored_services() as services, services.database.snapshot() as session:
        chain = verify(session, services.settings.key, kept)
    if chain.broken is not None:
        raise InputError(f"the audit log is broken: {chain.broken}")
    notes = [f"{chain.position} entries in the chain"]
    notes += (
        [f"details of {chain.erased} entries erased with the data of their persons"] if chain.erased else []
    )
    notes += [f"{chain.before} rows from before the chain existed"] if chain.before else []
    out.print(f"whole: {', '.join(notes)}\nhead {chain.position}:{chain.hash}")


def _head(text: str) -> tuple[int, str]:
    position, _, digest = text.partition(":")
    if not position.isdigit() or len(digest) != 64:
        raise InputError(
            f"--head: expected POSITION:HASH as `server audit verify` prints it, got '{text[:80]}'"
        )
    return int(position), digest


@app.command("export")
def export(
    out_file: Annotated[Path, typer.Option("--out", help="File to write; - for the terminal.")] = Path("-"),
    after: Annotated[int, typer.Option(min=0, help="Omit entries up to this position.")] = 0,
) -> None:
    """Write the entries as JSON lines; the last line says that it is complete, and the chain's head.

    Example: server audit export --out audit.ndjson
    """
    with stored_services() as services:
        if str(out_file) == "-":
            sys.stdout.writelines(_lines(services.database, after))
            return
        with whole_file(out_file) as unfinished, unfinished.open("w", encoding="utf-8") as stream:
            stream.writelines(_lines(services.database, after))


def _lines(database: Database, after: int) -> Iterator[str]:
    with database.snapshot() as session:
        number = 0
        for entry in repository.chained_entries(session, after):
            number += 1
            yield json.dumps(export_line(entry)) + "\n"
        position, digest = repository.last_link(session) or (0, "")
        yield json.dumps({"complete": True, "entries": number, "head": f"{position}:{digest}"}) + "\n"
