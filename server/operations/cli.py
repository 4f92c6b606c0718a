"""`server doctor` and `server database`."""

import json
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Annotated

import typer
from rich.text import Text

from experiments.command_groups import command_group
from experiments.errors import InputError, counted
from server.cli_common import migrated_services, out, require_database, stored_services
from server.context import open_services
from server.core.db import open_database
from server.core.migrate import current_revision, is_up_to_date, newest_revision
from server.core.settings import Settings
from server.core.values import iso, now
from server.operations.copying import address, carry_over, copy_database
from server.operations.doctor import Finding, examine
from server.operations.snapshots import (
    database_file,
    go_back,
    remove_superfluous,
    runs_in,
    snapshot_at,
    snapshots_of,
    take_snapshot,
)
from server.participation.tally_pools import repair
from server.privacy.erasures import replay
from server.privacy.rows import Content

# `server doctor` and `server database copy`.

WIDTH = 100
"""Characters of a line; a path or URL that is longer has a line to itself."""
COLORS = {"ok": "green", "warning": "yellow", "failed": "red"}


def register(parent: typer.Typer) -> None:
    """Add `server doctor` and `server database` to the command line."""
    _register_doctor(parent)
    _register_database(parent)


def _register_doctor(parent: typer.Typer) -> None:
    """Add the commands for the operator of the server."""
    parent.command("doctor")(doctor)


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable output.")] = False,
) -> None:
    """Check the installation and report what to fix; exit code 1 if a check failed.

    Nothing is changed. The keys of --json: a list of objects with subject, verdict (ok, warning, failed),
    state, advice.
    Example: server doctor
    """
    settings = Settings()
    require_database(settings)
    services = open_services(settings)
    try:
        findings = examine(services)
    finally:
        services.database.close()
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            out.print(_as_lines(finding), soft_wrap=True)
    if any(finding.verdict == "failed" for finding in findings):
        raise typer.Exit(1)


def _as_lines(finding: Finding) -> Text:
    """The verdict, what was found, and what to do on further lines; names that are long stay whole."""
    indent = " " * 9
    wrapped = partial(wrap, width=min(WIDTH, out.width), break_long_words=False, break_on_hyphens=False)
    lines = wrapped(
        f"{finding.subject}: {finding.state}", initial_indent=indent, subsequent_indent=f"{indent}  "
    )
    if finding.advice:
        lines += wrapped(finding.advice, initial_indent=f"{indent}> ", subsequent_indent=f"{indent}  ")
    shown = Text("\n".join(lines)[len(finding.verdict) :])
    return Text.assemble((finding.verdict, COLORS[finding.verdict]), shown)


def copy(
    source: Annotated[str, typer.Argument(help="Database URL to copy from.", show_default=False)],
    target: Annotated[str, typer.Argument(help="Database URL of an empty database.", show_default=False)],
) -> None:
    """Copy every row from one database to another and compare counts and hashes.

    Stop the server first: answers given during the copy would be lost. Clips and the secret key stay where
    they are. If any table differs, nothing is kept in the target.
    Example: server database copy sqlite:///data/palpebra.sqlite postgresql://me@db/lab
    """

    def told(name: str, content: Content) -> None:
        out.print(f"{name}: {counted(content.rows, 'row')}, {content.sha256[:12]} in both")

    copied = copy_database(source, target, told)
    rows = sum(content.rows for content in copied.values())
    out.print(f"{rows} rows in {len(copied)} tables; now set DATABASE_URL to {address(target)}")


# `server database snapshot`, `snapshots` and `go-back`.


def register_snapshots(app: typer.Typer) -> None:
    """Add the commands to `server database`."""
    app.command("snapshot")(snapshot)
    app.command("snapshots")(snapshots)
    app.command("go-back")(back)


def snapshot() -> None:
    """Take a snapshot of the SQLite database now; the server can keep running.

    With PALPEBRA_SNAPSHOT_MINUTES, the server takes them itself. They stay in the data folder: all of the
    last hour, one per hour of the last day, one per day of the last week.

    Example: server database snapshot
    """
    settings = Settings()
    taken = take_snapshot(settings)
    out.print(f"{taken.path}: {taken.path.stat().st_size / 1e6:.1f} MB")
    for one in remove_superfluous(settings, now()):
        out.print(f"removed {one.path}")


def snapshots() -> None:
    """List the snapshots, oldest first, with their size.

    Example: server database snapshots
    """
    settings = Settings()
    database_file(settings)
    there = snapshots_of(settings)
    for one in there:
        out.print(f"{iso(one.taken_at)}  {one.path.stat().st_size / 1e6:.1f} MB")
    if not there:
        out.print("no snapshots; set PALPEBRA_SNAPSHOT_MINUTES, or run: server database snapshot")


def back(
    moment: Annotated[
        str,
        typer.Argument(
            help="Use the last snapshot up to this time (UTC), such as 2026-11-24T10:15:00Z; or newest.",
            show_default=False,
        ),
    ],
) -> None:
    """Restore the SQLite database to an earlier moment; stop the server first.

    The current database is kept next to it under another name; remove it once everything works. People erased
    since then are erased again. Clips stay as they are.

    Examples:

      server database go-back 2026-11-24T10:15:00Z

      server database go-back newest
    """
    settings = Settings()
    database_file(settings)
    chosen = snapshot_at(settings, _moment(moment))
    before = go_back(settings, chosen, out.print)
    runs = counted(runs_in(settings), "run")
    out.print(f"restored the database as of {iso(chosen.taken_at)}, with {runs}")
    out.print(f"the previous database is kept at {before}")


def _moment(given: str) -> datetime:
    if given == "newest":
        return now()
    try:
        moment = datetime.fromisoformat(given)
    except ValueError:
        raise InputError(f"expected a time such as 2026-11-24T10:15:00Z, or newest; got '{given}'") from None
    return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)


# `server database`: bring the database to the newest revision, report which one it has, copy it, count again.

app = command_group("The database's tables.")


def _register_database(parent: typer.Typer) -> None:
    """Add `server database` to the command line."""
    parent.add_typer(app, name="database")
    app.command("copy")(copy)
    register_snapshots(app)


@app.command("upgrade")
def upgrade() -> None:
    """Create or upgrade the tables for this version of the program; nothing happens if they are current.

    The database is DATABASE_URL, or SQLite in the data folder.
    Example: DATABASE_URL=postgresql://me@localhost/palpebra server database upgrade
    """
    with migrated_services() as services:
        address = services.database.url.render_as_string(hide_password=True)
        out.print(f"{address}: revision {current_revision(services.database)}")


@app.command("status")
def status() -> None:
    """Show the revision of the database, and the one that this program expects.

    Example: server database status
    """
    database = open_database(Settings())
    revision, expected, fits = current_revision(database), newest_revision(), is_up_to_date(database)
    database.close()
    views = " and other views" if revision == expected and not fits else ""
    advice = "" if fits else "; run `server database upgrade`"
    out.print(f"found {revision or 'no tables'}{views}, expected {expected}{advice}")


@app.command("recount")
def recount() -> None:
    """Count every run's ratings again and correct those that differ; the server can keep running.

    Results, monitor and participants read these counts; `server doctor` checks them.
    Example: server database recount
    """
    with stored_services() as services:
        mended, runs = repair(services.database, services.versions)
    out.print(f"{counted(runs, 'run')} counted, {mended} corrected")


@app.command("rewrap")
def rewrap(
    old_key_file: Annotated[
        Path,
        typer.Argument(
            help="File with the previous secret key (the old data/secret_key).", show_default=False
        ),
    ],
) -> None:
    """After a change of the secret key, re-encrypt what the old key protects.

    Recruiters' IDs, second factors and the chain of the audit log are converted to the key of the settings.
    Afterwards make a new backup and store the old key apart from your backups. Keep it: earlier backups can
    only be restored with it (server restore FILE --keys).
    Example: server database rewrap /media/safe/secret_key
    """
    try:
        old = old_key_file.read_bytes().strip()
    except OSError as error:
        raise InputError(f"{old_key_file} cannot be read: {error.strerror or error}") from error
    with stored_services() as services, services.database.write() as session:
        carried = carry_over(session, old, services.settings.key)
    out.print(
        f"{carried.identities} keys re-encrypted; {carried.unreadable} were not encrypted with the old key"
    )
    out.print(f"{counted(carried.second_factors, 'second factor')} re-encrypted")
    out.print(
        "move palpebra-keys.json to the existing backups, which can only be restored with it (server "
        "restore FILE --keys); then make a new backup"
    )
    if carried.broken is not None:
        raise InputError(
            "second factors and the audit log were left as they are, as the log fits neither key: "
            f"{carried.broken}; recruiters' IDs are carried over. If the key was changed twice, carry "
            "over to the key in between first, then to the current one"
        )
    out.print(
        "the chain of the audit log was rebuilt; save its new head (server audit verify), because older "
        "heads no longer match"
    )


@app.command("erase-again")
def erase_again() -> None:
    """Erase again the runs listed in the ledger of erasures (erasures.ndjson in the data folder).

    `server restore` does this itself. Use it if the ledger was added later, or if the database was restored
    by other means.
    Example: server database erase-again
    """
    with stored_services() as services, services.database.write() as session:
        erased = replay(session, services.settings)
    out.print(f"{counted(erased, 'run')} erased")
