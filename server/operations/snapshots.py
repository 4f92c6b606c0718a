"""Snapshots of a SQLite database: whole copies, from which it goes back to a moment between two backups."""

import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from experiments.errors import InputError
from server.clock import now
from server.db import Database, checked_url, open_database
from server.file_locks import locked
from server.migrate import upgrade
from server.operations.erasures import ledger
from server.operations.snapshot_repository import copied, put_into_one_file
from server.runs.erasure import replay
from server.settings import Settings

FOLDER, LOCK = "snapshots", "snapshots.lock"
ALL_OF, HOURLY_OF, DAILY_OF = timedelta(hours=1), timedelta(days=1), timedelta(days=7)
"""How far back every snapshot stays, the last one of each hour, and the last one of each day (UTC)."""
COMMITTED_WITHIN_S = 60.0
"""How long after its line in the ledger an erasure may take to be in the database."""
_NAME = "palpebra-%Y-%m-%dT%H%M%SZ.sqlite"
_BEFORE = "-before-"


@dataclass(frozen=True, order=True)
class Snapshot:
    """One snapshot.

    Attributes
    ----------
    taken_at : datetime
        The moment of its rows.
    path : Path
    """

    taken_at: datetime
    path: Path


class SnapshotUnderWayError(InputError):
    """Another process takes a snapshot."""


def database_file(settings: Settings) -> Path:
    """The file of the SQLite database; InputError where the database is another one."""
    url = checked_url(settings.resolved_database_url)
    if url.get_backend_name() != "sqlite" or not url.database or url.database == ":memory:":
        raise InputError(
            "snapshots are of a database that is a SQLite file; PostgreSQL goes back to a moment by "
            "deploy/point-in-time.sh (docs/deployment.md)"
        )
    return Path(url.database)


def snapshots_of(settings: Settings) -> list[Snapshot]:
    """The snapshots there are, oldest first; files with other names are passed over."""
    known = []
    for path in (settings.data_folder / FOLDER).glob("palpebra-*.sqlite"):
        try:
            known.append(Snapshot(datetime.strptime(path.name, _NAME).replace(tzinfo=UTC), path))
        except ValueError:
            continue
    return sorted(known)


def aside(database: Path, moment: datetime) -> Path:
    """What the database of before is called once another took its place."""
    return database.with_name(f"{database.stem}{_BEFORE}{moment:%Y-%m-%dT%H%M%SZ}{database.suffix}")


def set_aside(settings: Settings) -> list[Path]:
    """The databases of before, oldest first."""
    path = database_file(settings)
    return sorted(path.parent.glob(f"{path.stem}{_BEFORE}*{path.suffix}"))


def take_snapshot(settings: Settings) -> Snapshot:
    """Copy the database while it is in use, look whether the copy is sound, and keep it; mode 600.

    Raises
    ------
    InputError
        The database is no SQLite file or is damaged, or there is no room.
    SnapshotUnderWayError
        Another process takes one.
    """
    source = database_file(settings)
    if not source.is_file():
        raise InputError(f"{source} is not there yet; start the server once, or run: server database upgrade")
    folder = settings.data_folder / FOLDER
    try:
        with locked(folder / LOCK, wait=False):
            _remove_torn(folder)
            moment = now().replace(microsecond=0)
            snapshot = Snapshot(moment, folder / moment.strftime(_NAME))
            _copy(source, folder / f".{snapshot.path.name}", snapshot.path)
    except BlockingIOError:
        raise SnapshotUnderWayError("another snapshot is being taken; wait until it has ended") from None
    except (OSError, sqlite3.Error) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(f"{source} cannot be copied into {folder}: {said}") from error
    return snapshot


def _copy(source: Path, temporary: Path, target: Path) -> None:
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    try:
        if (said := copied(source, temporary)) != "ok":
            raise InputError(f"{source} is not sound: {said.splitlines()[-1]}; run: server doctor")
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _remove_torn(folder: Path) -> None:
    """What a process that was killed left of its copy."""
    for path in folder.glob(".palpebra-*.sqlite*"):
        path.unlink(missing_ok=True)


def is_due(settings: Settings, moment: datetime) -> bool:
    """True where the time is up since the newest snapshot and the database was written to since."""
    taken = snapshots_of(settings)
    if not taken:
        return True
    if moment - taken[-1].taken_at < timedelta(minutes=settings.snapshot_minutes):
        return False
    return changed_at(database_file(settings)) > taken[-1].taken_at


def changed_at(database: Path) -> datetime:
    """When the database's file, or what is still to be put into it, was last written to."""
    files = (database, database.with_name(f"{database.name}-wal"))
    return datetime.fromtimestamp(max(path.stat().st_mtime for path in files if path.exists()), UTC)


def superfluous(moments: Iterable[datetime], moment: datetime) -> list[datetime]:
    """The moments of snapshots that go, oldest first: see `ALL_OF`, `HOURLY_OF`, `DAILY_OF`.

    The newest stays, however old it is.
    """
    kept: dict[str, datetime] = {}
    ordered = sorted(moments)
    for taken in ordered:
        age = moment - taken
        if age <= ALL_OF:
            kept[taken.isoformat()] = taken
        elif age <= HOURLY_OF:
            kept[f"{taken:%Y-%m-%dT%H}"] = taken
        elif age <= DAILY_OF:
            kept[f"{taken:%Y-%m-%d}"] = taken
    staying = {*kept.values(), *ordered[-1:]}
    return [taken for taken in ordered if taken not in staying]


def remove_superfluous(settings: Settings, moment: datetime) -> list[Snapshot]:
    """Remove the snapshots that are too many or too old; return them."""
    there = snapshots_of(settings)
    going = set(superfluous((one.taken_at for one in there), moment))
    removed = [one for one in there if one.taken_at in going]
    for one in removed:
        one.path.unlink(missing_ok=True)
    return removed


def erase_in_snapshots(settings: Settings) -> int:
    """Erase in every snapshot what the ledger of erasures names since; return how many snapshots were opened.

    The time stamp of a snapshot's file tells up to when the ledger was carried out in it.
    """
    path = ledger(settings)
    if not path.is_file():
        return 0
    # The ledger is written before the erasure is committed: a snapshot between the two holds what was erased.
    noted_at = path.stat().st_mtime + COMMITTED_WITHIN_S
    behind = [one.path for one in snapshots_of(settings) if one.path.stat().st_mtime <= noted_at]
    for snapshot in behind:
        erase_again(settings, snapshot)
    return len(behind)


def erase_again(settings: Settings, snapshot: Path) -> int:
    """Bring a copy to the newest revision and erase in it what the ledger names; return how many runs."""
    with opened_copy(settings, snapshot) as database:
        upgrade(database)
        with database.write() as session:
            erased = replay(session, settings)
    os.utime(snapshot)
    return erased


@contextmanager
def opened_copy(settings: Settings, path: Path) -> Iterator[Database]:
    """A copy as the server opens its database; one file again afterwards."""
    database = open_database(settings.model_copy(update={"database_url": f"sqlite:///{path.resolve()}"}))
    try:
        yield database
    finally:
        database.close()
    put_into_one_file(path)
