"""`server database`: bring the database to the newest revision, say which one it has, copy it, count anew."""

import typer

from server.cli_common import migrated_services, out
from server.db import open_database
from server.migrate import current_revision, newest_revision
from server.operations.cli import copy
from server.runs.erasure import replay
from server.settings import Settings
from server.tallies.recount import repair

app = typer.Typer(help="The database's tables.", no_args_is_help=True)


def register(parent: typer.Typer) -> None:
    """Add `server database` to the command line."""
    parent.add_typer(app, name="database")
    app.command("copy")(copy)


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
    """Say which revision the database has, and which this program expects."""
    database = open_database(Settings())
    found, expected = current_revision(database), newest_revision()
    database.close()
    advice = "" if found == expected else "; run `server database upgrade`"
    out.print(f"found {found or 'no tables'}, expected {expected}{advice}")


@app.command("recount")
def recount() -> None:
    """Count every run's ratings anew and mend the counts that differ; the server may go on meanwhile.

    Results, monitor and participants read these counts; `server doctor` says whether they are right.
    Example: server database recount
    """
    with migrated_services() as services:
        mended, runs = repair(services.database, services.versions)
    out.print(f"{runs} runs counted, {mended} mended")


@app.command("erase-again")
def erase_again() -> None:
    """Erase the runs that the ledger of erasures names (erasures.ndjson in the data folder).

    `server restore` does so by itself; this is for a ledger that was put there afterwards, or for a database
    that was brought back by other means.
    Example: server database erase-again
    """
    with migrated_services() as services, services.database.write() as session:
        erased = replay(session, services.settings)
    out.print(f"{erased} runs erased")
