"""Snapshots of a SQLite database, taken by schedule, and going back to one."""

import asyncio
import logging
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractAsyncContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from experiments.errors import InputError, counted
from server.accounts.audit import record
from server.core.changes import background_task
from server.core.db import Database, checked_url, open_database
from server.core.locks import file_lock
from server.core.migrate import upgrade
from server.core.settings import Settings
from server.core.values import iso, now
from server.operations.repository import run_counts
from server.privacy.erasures import replay
from server.privacy.ledger import ledger_path

# What snapshots ask of SQLite itself: a copy, one file without a WAL, a database that nobody else uses.


def copy_database_file(source: Path, target: Path) -> str:
    """Copy by SQLite's backup API, in one step: it sees one moment, and in WAL mode holds up no writer.

    Returns
    -------
    str
        `ok`, or what is not sound about the copy.
    """
    with closing(sqlite3.connect(source)) as reading, closing(sqlite3.connect(target)) as connection:
        reading.backup(connection)
        connection.execute("PRAGMA journal_mode=DELETE")
        (said,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    return str(said)


def put_into_one_file(path: Path) -> None:
    """Leave WAL mode, so that the file says all by itself; the next connection of a server takes it up."""
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA journal_mode=DELETE")


@contextmanager
def closed_to_others(path: Path) -> Iterator[None]:
    """Hold the database alone; one that is damaged beyond opening is let through: it is to be replaced."""
    if not path.is_file():
        yield
        return
    with closing(sqlite3.connect(path, timeout=1, isolation_level=None)) as connection:
        try:
            # SQLite leaves WAL mode only where nobody else has the file open; what waited goes into it then.
            connection.execute("PRAGMA journal_mode=DELETE").fetchone()
            connection.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            raise InputError(
                f"another program has {path} open ({error}); stop the server first. Nothing was changed"
            ) from error
        except sqlite3.DatabaseError:
            pass
        yield


# Snapshots of a SQLite database: whole copies, from which it goes back to a moment between two backups.

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
            "snapshots need a SQLite file; for PostgreSQL, use deploy/point-in-time.sh "
            "(docs/how-to/go-back-in-time.md)"
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


def path_aside(database: Path, moment: datetime) -> Path:
    """The file name of the earlier database after another replaced it."""
    return database.with_name(f"{database.stem}{_BEFORE}{moment:%Y-%m-%dT%H%M%SZ}{database.suffix}")


def set_aside(settings: Settings) -> list[Path]:
    """The replaced databases, oldest first."""
    path = database_file(settings)
    return sorted(path.parent.glob(f"{path.stem}{_BEFORE}*{path.suffix}"))


def take_snapshot(settings: Settings) -> Snapshot:
    """Copy the database while it is in use, look whether the copy is sound, and keep it; mode 600.

    Raises
    ------
    InputError
        The database is not a SQLite file or is damaged, or there is no room.
    SnapshotUnderWayError
        Another process takes one.
    """
    source = database_file(settings)
    if not source.is_file():
        raise InputError(
            f"{source} does not exist yet; start the server once, or run: server database upgrade"
        )
    folder = settings.data_folder / FOLDER
    try:
        with file_lock(folder / LOCK, wait=False):
            _remove_torn(folder)
            moment = now().replace(microsecond=0)
            snapshot = Snapshot(moment, folder / moment.strftime(_NAME))
            _copy(source, folder / f".{snapshot.path.name}", snapshot.path)
    except BlockingIOError:
        raise SnapshotUnderWayError("another snapshot is being taken; wait until it has finished") from None
    except (OSError, sqlite3.Error) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(f"{source} cannot be copied into {folder}: {said}") from error
    return snapshot


def _copy(source: Path, temporary: Path, target: Path) -> None:
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    try:
        if (said := copy_database_file(source, temporary)) != "ok":
            raise InputError(f"{source} is damaged: {said.splitlines()[-1]}; run: server doctor")
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


def superfluous_snapshots(moments: Iterable[datetime], moment: datetime) -> list[datetime]:
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
    going = set(superfluous_snapshots((one.taken_at for one in there), moment))
    removed = [one for one in there if one.taken_at in going]
    for one in removed:
        one.path.unlink(missing_ok=True)
    return removed


def erase_in_snapshots(settings: Settings) -> int:
    """Erase in every snapshot what the ledger of erasures names since; return how many snapshots were opened.

    The time stamp of a snapshot's file shows up to when the ledger was carried out in it.
    """
    path = ledger_path(settings)
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


# `server database go-back`: a SQLite database as a snapshot has it, with what was there before set aside.

BESIDE = ("", "-wal", "-shm")
"""Endings of a SQLite database's files: itself, what is to be put into it, and the index of that."""


def snapshot_at(settings: Settings, moment: datetime) -> Snapshot:
    """The last snapshot taken up to a moment; InputError, naming those there are, where there is none."""
    there = snapshots_of(settings)
    earlier = [one for one in there if one.taken_at <= moment]
    if not there:
        raise InputError(
            "there are no snapshots; set PALPEBRA_SNAPSHOT_MINUTES and keep the server running, or restore "
            "a backup: server restore FILE"
        )
    if not earlier:
        raise InputError(
            f"there is no snapshot up to {iso(moment)}; the first is from {iso(there[0].taken_at)}, the "
            f"last from {iso(there[-1].taken_at)}"
        )
    return earlier[-1]


def go_back(settings: Settings, snapshot: Snapshot, told: Callable[[str], None]) -> Path:
    """Put a snapshot in the place of the database; return where the replaced database was set aside.

    The snapshot is copied, brought to the newest revision and the ledger of erasures carried out in it before
    anything is moved, so that nothing is changed where any of it fails.

    Raises
    ------
    InputError
        Another program has the database open, or there is no room for the copy.
    """
    path = database_file(settings)
    before = path_aside(path, now())
    coming = path.with_name(f".{path.name}.coming")
    with closed_to_others(path):
        try:
            shutil.copyfile(snapshot.path, coming)
            coming.chmod(0o600)
            erased = erase_again(settings, coming)
            told(f"{counted(erased, 'run')} erased again, by the ledger of erasures")
            _note(settings, coming, snapshot)
            for ending in BESIDE:
                if (file := path.with_name(path.name + ending)).exists():
                    file.rename(before.with_name(before.name + ending))
            coming.rename(path)
        except OSError as error:
            raise InputError(f"{coming} cannot be written: {error.strerror or error}") from error
        finally:
            for ending in BESIDE:
                coming.with_name(coming.name + ending).unlink(missing_ok=True)
    return before


def _note(settings: Settings, coming: Path, snapshot: Snapshot) -> None:
    """In the audit log, which goes back too."""
    with opened_copy(settings, coming) as database, database.write() as session:
        record(session, None, "database taken back", "database", iso(snapshot.taken_at))


def runs_in(settings: Settings) -> int:
    """How many runs the database holds."""
    database = open_database(settings)
    try:
        with database.read() as session:
            return sum(int(count) for *_, count in run_counts(session))
    finally:
        database.close()


# The snapshots that the server takes by itself of a SQLite database.

LOG = logging.getLogger(__name__)
LOOK_EVERY_S = 20.0


def snapshots_taken(
    settings: Settings, look_every_s: float = LOOK_EVERY_S
) -> AbstractAsyncContextManager[None]:
    """Take snapshots while the server runs; nothing where the settings ask for none, or on PostgreSQL."""
    url = checked_url(settings.resolved_database_url)
    if not settings.snapshot_minutes or url.get_backend_name() != "sqlite":
        return nullcontext()
    return background_task(lambda _: _watch(settings, look_every_s))


async def _watch(settings: Settings, look_every_s: float) -> None:
    while True:
        await asyncio.sleep(look_every_s)
        try:
            await asyncio.to_thread(take_due_snapshot, settings)
        except InputError as error:  # such as no room: in words, and the next look comes
            LOG.error("snapshot: %s", error)
        except Exception:  # the next look comes, whatever went wrong with this one
            LOG.exception("snapshot")


def take_due_snapshot(settings: Settings) -> None:
    """Take a snapshot if one is due, remove what is too many, and erase in the others who was erased."""
    if is_due(settings, now()):
        try:
            snapshot = take_snapshot(settings)
        except SnapshotUnderWayError:  # another worker is at it
            return
        LOG.info("snapshot %s", snapshot.path.name)
        remove_superfluous(settings, now())
    erase_in_snapshots(settings)
