"""`server database`: bring the database to the newest revision, say which one it has, copy it, count anew."""

from pathlib import Path
from typing import Annotated

import typer

from experiments.command_groups import command_group
from experiments.counted import counted
from experiments.errors import InputError
from server.cli_common import migrated_services, out, stored_services
from server.db import open_database
from server.migrate import current_revision, newest_revision
from server.operations import cli_snapshots
from server.operations.cli import copy
from server.operations.new_key import carry_over
from server.runs.erasure import replay
from server.settings import Settings
from server.tallies.recount import repair

app = command_group("The database's tables.")


def register(parent: typer.Typer) -> None:
    """Add `server database` to the command line."""
    parent.add_typer(app, name="database")
    app.command("copy")(copy)
    cli_snapshots.register(app)


@app.command("upgrade")
def upgrade() -> None:
    """Make or change the tables so that they fit this program; nothing happens where they do.

    The database is DATABASE_URL, or SQLite in the data folder.
    Example: DATABASE_URL=postgresql://me@localhost/palpebra server database upgrade
    """
    with migrated_services() as services:
        address = services.database.url.render_as_string(hide_password=True)
        out.print(f"{address}: revision {current_revision(services.database)}")


@app.command("status")
def status() -> None:
    """Say which revision the database has, and which this program expects.

    Example: server database status
    """
    database = open_database(Settings())
    revision, expected = current_revision(database), newest_revision()
    database.close()
    advice = "" if revision == expected else "; run `server database upgrade`"
    out.print(f"found {revision or 'no tables'}, expected {expected}{advice}")


@app.command("recount")
def recount() -> None:
    """Count every run's ratings anew and mend the counts that differ; the server may go on meanwhile.

    Results, monitor and participants read these counts; `server doctor` says whether they are right.
    Example: server database recount
    """
    with stored_services() as services:
        mended, runs = repair(services.database, services.versions)
    out.print(f"{counted(runs, 'run')} counted, {mended} mended")


@app.command("rewrap")
def rewrap(
    old_key_file: Annotated[
        Path, typer.Argument(help="The secret key of before, as data/secret_key was.", show_default=False)
    ],
) -> None:
    """Carry over what was kept under the old key, after the secret key was changed.

    Recruiters' ids, second factors and the audit log's chain are made to fit the key of the settings. Move
    the key file away from beside your backups afterwards and back up anew, but keep it: the backups made so
    far open with it alone (server restore FILE --keys).
    Example: server database rewrap /media/safe/secret_key
    """
    try:
        old = old_key_file.read_bytes().strip()
    except OSError as error:
        raise InputError(f"{old_key_file} cannot be read: {error.strerror or error}") from error
    with stored_services() as services, services.database.write() as session:
        carried = carry_over(session, old, services.settings.key)
    out.print(f"{carried.identities} keys wrapped anew; {carried.unreadable} are not under that key")
    out.print(f"{counted(carried.second_factors, 'second factor')} carried over")
    out.print(
        "move palpebra-keys.json away and keep it with the backups made so far, which open with it alone "
        "(server restore FILE --keys); then back up anew"
    )
    if carried.broken is not None:
        raise InputError(
            "second factors and the audit log were left as they are, as the log fits neither key: "
            f"{carried.broken}; recruiters' ids are carried over. Where the key was changed twice, set the "
            "one between, carry over the first to it, then that one to the last"
        )
    out.print(
        "the audit log's chain is made anew; note its head (server audit verify), older ones fit no more"
    )


@app.command("erase-again")
def erase_again() -> None:
    """Erase the runs that the ledger of erasures names (erasures.ndjson in the data folder).

    `server restore` does so by itself; this is for a ledger that was put there afterwards, or for a database
    that was brought back by other means.
    Example: server database erase-again
    """
    with stored_services() as services, services.database.write() as session:
        erased = replay(session, services.settings)
    out.print(f"{counted(erased, 'run')} erased")
