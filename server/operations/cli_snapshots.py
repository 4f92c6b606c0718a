"""`server database snapshot`, `snapshots` and `go-back`."""

from datetime import UTC, datetime
from typing import Annotated

import typer

from experiments.counted import counted
from experiments.errors import InputError
from server.cli_common import out
from server.clock import iso, now
from server.operations.going_back import go_back, runs_in, snapshot_at
from server.operations.snapshots import database_file, remove_superfluous, snapshots_of, take_snapshot
from server.settings import Settings


def register(app: typer.Typer) -> None:
    """Add the commands to `server database`."""
    app.command("snapshot")(snapshot)
    app.command("snapshots")(snapshots)
    app.command("go-back")(back)


def snapshot() -> None:
    """Take a snapshot of the SQLite database now, while the server goes on.

    The server takes them by itself where PALPEBRA_SNAPSHOT_MINUTES is set. They stay in the data folder: all
    of the last hour, one an hour of the last day, one a day of the last week.

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
            help="The last snapshot up to this moment (UTC) is taken, as 2026-11-24T10:15:00Z; or newest.",
            show_default=False,
        ),
    ],
) -> None:
    """Make the SQLite database as it was at a moment; stop the server first.

    What is there now is set aside beside it under another name: remove it once all is well. Whoever was
    erased since is erased again; clips stay, they are kept by their content.

    Examples:

      server database go-back 2026-11-24T10:15:00Z

      server database go-back newest
    """
    settings = Settings()
    database_file(settings)
    chosen = snapshot_at(settings, _moment(moment))
    before = go_back(settings, chosen, out.print)
    runs = counted(runs_in(settings), "run")
    out.print(f"the database is as it was at {iso(chosen.taken_at)}, with {runs}")
    out.print(f"what was there before: {before}")


def _moment(given: str) -> datetime:
    if given == "newest":
        return now()
    try:
        moment = datetime.fromisoformat(given)
    except ValueError:
        raise InputError(f"expected a moment as 2026-11-24T10:15:00Z, or newest; got '{given}'") from None
    return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
