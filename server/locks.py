"""What only one process of a server may do at a time: locks in PostgreSQL, or files beside SQLite."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Protocol

from server.clock import now
from server.db import Database
from server.file_locks import is_left, locked
from server.locks_repository import DatabaseLocks, LockTaken
from server.models import Job
from server.settings import Settings

BEGINS_WITHIN = timedelta(seconds=15)
"""Between the row of a job and its lock: where the process ended there, others see it after so long."""
LONGEST_S = 1800
"""How long a job may take."""
NO_JOB_TAKES = timedelta(seconds=2 * LONGEST_S)
"""Longer than any job: it tells of one whose lock file this computer never had."""


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
                held.enter_context(locked(self._folder / f"{name}.lock", wait=False))
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
                held.enter_context(locked(path))
            yield
            path.unlink(missing_ok=True)

    def job_is_left(self, job: Job) -> bool:
        """Whether the process of a job that is not over has ended; by its age where no file tells."""
        path = self._folder / job.public_id
        if path.exists():
            return is_left(path)
        return now() - (job.started_at or job.created_at) > NO_JOB_TAKES


def open_locks(settings: Settings, database: Database) -> Locks:
    """The locks of a server with this database."""
    if database.is_sqlite:
        return FileLocks(settings.data_folder / "jobs")
    return SharedLocks(DatabaseLocks(database))
