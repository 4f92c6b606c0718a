"""What only one process of a server may do at a time: locks in PostgreSQL, or files next to SQLite."""

import hashlib
import logging
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Protocol

from filelock import FileLock, Timeout
from sqlalchemy import Connection, NullPool, create_engine, text
from sqlalchemy.exc import DBAPIError

from server.core.db import Database, kept_alive
from server.core.settings import Settings
from server.core.values import now
from server.models import Job

# A lock file, held by one process at a time.


@contextmanager
def file_lock(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold the lock of a file, which is made where it is missing; it ends with the process at the latest.

    Raises
    ------
    BlockingIOError
        Another process holds it, and `wait` is false.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        held = _lock_of_file(path).acquire(timeout=-1 if wait else 0)
    except Timeout as error:
        raise BlockingIOError(f"another process holds {path}") from error
    with held:
        path.chmod(0o600)  # the file may be older than this rule
        yield


def is_left(path: Path) -> bool:
    """Whether a lock file is there and no process holds it: its process ended before its work."""
    if not path.is_file():
        return False
    try:
        with _lock_of_file(path).acquire(timeout=0):
            return True
    except Timeout:
        return False


def _lock_of_file(path: Path) -> FileLock:
    # Never a soft lock: that is a file's presence, which outlives a process that was killed.
    return FileLock(
        path,
        mode=0o600,
        poll_interval=0.02,
        thread_local=False,
        fallback_to_soft=False,
        preserve_lock_file=True,
    )


# Locks that PostgreSQL keeps for all processes of a server: each ends with the process that holds it.
#
# One connection of a process holds all of its locks, however many there are; another lets others see
# whether a lock is held. A host that goes without a word lets go of its locks within a minute. Where
# PostgreSQL is restarted, the process notices within `HEARTBEAT_S` and takes its locks again; where the
# network was cut, as soon as PostgreSQL has noticed too, and ended the earlier connection that still
# holds them.

LOG = logging.getLogger(__name__)
HEARTBEAT_S = 5.0
OWN_LINE_S = 60.0
"""By then an earlier connection has ended for PostgreSQL too: whatever holds a lock now is another's."""
_ALIVE = "SET tcp_keepalives_idle = 20; SET tcp_keepalives_interval = 10; SET tcp_keepalives_count = 3"


class LockTaken(Exception):
    """Another process, or another thread of this one, holds the lock."""


# Decision 0780: Hosts share PostgreSQL and one folder.
class DatabaseLocks:
    """The locks of one process; each has a name."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._engine = create_engine(
            kept_alive(database.url), poolclass=NullPool, isolation_level="AUTOCOMMIT", hide_parameters=True
        )
        self._changing = threading.Lock()
        self._held: set[int] = set()
        self._lost: dict[int, float] = {}  # of those held, not regained -> since when
        self._connection: Connection | None = None
        self._let_all_go = threading.Event()

    @contextmanager
    def held(self, name: str) -> Iterator[None]:
        """Hold a lock.

        Raises
        ------
        LockTaken
            It is held by another.
        """
        number = _number(name)
        with self._changing:
            # PostgreSQL gives a lock again to the connection that has it: threads are distinguished here.
            if number in self._held or not self._taken(number):
                if not self._held:
                    self._close()  # nothing holds it open, and nothing would close it
                raise LockTaken(name)
            self._held.add(number)
            if len(self._held) == 1:
                self._let_all_go = threading.Event()
                threading.Thread(target=self._beat, args=(self._let_all_go,), daemon=True).start()
        try:
            yield
        finally:
            with self._changing:
                self._held.discard(number)
                self._lost.pop(number, None)
                self._let_go(number)

    def is_held(self, name: str) -> bool:
        """Whether any process holds a lock."""
        number = _number(name)
        # Its own word goes: also if PostgreSQL was restarted meanwhile.
        if number in self._held and number not in self._lost:
            return True
        query = text("SELECT pg_try_advisory_xact_lock_shared(:number)")
        with self._database.engine.connect() as connection:
            return not connection.scalar(query, {"number": number})

    def _taken(self, number: int) -> bool:
        for _ in range(2):
            try:
                return bool(
                    self._open().scalar(text("SELECT pg_try_advisory_lock(:number)"), {"number": number})
                )
            except DBAPIError as error:
                if not error.connection_invalidated:
                    raise
                self._close()  # PostgreSQL was started anew: the locks went with the connection
        return False

    def _beat(self, let_all_go: threading.Event) -> None:
        """Look after the connection for as long as a lock is held."""
        while not let_all_go.wait(HEARTBEAT_S):
            with self._changing:
                if let_all_go.is_set():
                    return
                try:
                    self._regain(self._open())
                except DBAPIError:
                    self._close()
                    self._retake()

    def _retake(self) -> None:
        """Open another connection, which takes the locks again; the next beat tries it where this fails."""
        try:
            self._open()
        except DBAPIError as error:
            self._close()
            LOG.warning("locks are not held: %s", type(error.orig).__name__)

    def _open(self) -> Connection:
        if self._connection is None:
            self._connection = self._engine.connect()
            self._connection.exec_driver_sql(_ALIVE)
            self._lost = {number: self._lost.get(number, time.monotonic()) for number in self._held}
            self._regain(self._connection)
        return self._connection

    def _regain(self, connection: Connection) -> None:
        """Ask for the locks that were lost with a connection; the lost one may hold them a little longer."""
        connection.exec_driver_sql("SELECT 1")
        for number, since in list(self._lost.items()):
            if connection.scalar(text("SELECT pg_try_advisory_lock(:number)"), {"number": number}):
                del self._lost[number]
            elif time.monotonic() - since > OWN_LINE_S:
                self._lost[number] = float("inf")  # told once
                LOG.error("a lock was lost while PostgreSQL was away: another process holds it now")

    def _let_go(self, number: int) -> None:
        try:
            if self._connection is not None:
                # By word, too, where the connection is closed next: its end is noticed a little later.
                self._connection.execute(text("SELECT pg_advisory_unlock(:number)"), {"number": number})
        except DBAPIError:
            self._close()
        if not self._held:
            self._let_all_go.set()
            self._close()

    def _close(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()


def _number(name: str) -> int:
    digest = hashlib.blake2b(name.encode(), digest_size=8, person=b"palpebra locks").digest()
    return int.from_bytes(digest, "big", signed=True)


# What only one process of a server may do at a time: locks in PostgreSQL, or files next to SQLite.

BEGINS_WITHIN = timedelta(seconds=15)
"""Between the row of a job and its lock: where the process ended there, others see it after so long."""
LONGEST_S = 1800
"""How long a job may take."""
NO_JOB_TAKES = timedelta(seconds=2 * LONGEST_S)
"""Longer than any job: it identifies one whose lock file this computer never had."""


class Locks(Protocol):
    """The locks of one process."""

    def held(self, name: str) -> AbstractContextManager[None]:
        """Hold a lock; LockTaken where another does."""

    def of_job(self, public_id: str) -> AbstractContextManager[None]:
        """Held while a job goes on."""

    def job_is_left(self, job: Job) -> bool:
        """Whether the process of a job that is not over has ended."""


class SharedLocks:
    """Locks in the database of the server, the same for every host."""

    def __init__(self, locks: DatabaseLocks) -> None:
        self._locks = locks

    def held(self, name: str) -> AbstractContextManager[None]:
        """Hold a lock; LockTaken where another does."""
        return self._locks.held(name)

    def of_job(self, public_id: str) -> AbstractContextManager[None]:
        """Held while a job goes on."""
        return self._locks.held(f"job {public_id}")

    def job_is_left(self, job: Job) -> bool:
        """Whether the process of a job that is not over has ended."""
        return now() - job.created_at > BEGINS_WITHIN and not self._locks.is_held(f"job {job.public_id}")


class FileLocks:
    """Lock files: SQLite's processes are all on one computer."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @contextmanager
    def held(self, name: str) -> Iterator[None]:
        """Hold a lock; LockTaken where another does."""
        with ExitStack() as held:
            try:
                held.enter_context(file_lock(self._folder / f"{name}.lock", wait=False))
            except BlockingIOError:
                raise LockTaken(name) from None
            except ImportError:  # a system without such locks has one process alone
                pass
            yield

    @contextmanager
    def of_job(self, public_id: str) -> Iterator[None]:
        """Held while a job goes on."""
        path = self._folder / public_id
        with ExitStack() as held:
            with suppress(ImportError):  # a system without such locks: the job's age alone tells
                held.enter_context(file_lock(path))
            yield
            with suppress(PermissionError):  # Windows keeps a file that is open
                path.unlink(missing_ok=True)

    def job_is_left(self, job: Job) -> bool:
        """Whether the process of a job that is not over has ended; by its age if there is no file."""
        path = self._folder / job.public_id
        if path.exists():
            return is_left(path)
        return now() - (job.started_at or job.created_at) > NO_JOB_TAKES


def open_locks(settings: Settings, database: Database) -> Locks:
    """The locks of a server with this database."""
    if database.is_sqlite:
        return FileLocks(settings.data_folder / "jobs")
    return SharedLocks(DatabaseLocks(database))
