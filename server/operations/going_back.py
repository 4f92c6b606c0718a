"""`server database go-back`: a SQLite database as a snapshot has it, with what was there before set aside."""

import shutil
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from experiments.counted import counted
from experiments.errors import InputError
from server.accounts.audit import record
from server.clock import iso, now
from server.db import open_database
from server.operations.repository import run_counts
from server.operations.snapshot_repository import closed_to_others
from server.operations.snapshots import Snapshot, aside, database_file, erase_again, opened_copy, snapshots_of
from server.settings import Settings

BESIDE = ("", "-wal", "-shm")
"""Endings of a SQLite database's files: itself, what is to be put into it, and the index of that."""


def snapshot_at(settings: Settings, moment: datetime) -> Snapshot:
    """The last snapshot taken up to a moment; InputError, naming those there are, where there is none."""
    there = snapshots_of(settings)
    earlier = [one for one in there if one.taken_at <= moment]
    if not there:
        raise InputError(
            "there are no snapshots; set PALPEBRA_SNAPSHOT_MINUTES and let the server run, or go back to a "
            "backup: server restore FILE"
        )
    if not earlier:
        raise InputError(
            f"no snapshot was taken up to {iso(moment)}; the first is of {iso(there[0].taken_at)}, the last "
            f"of {iso(there[-1].taken_at)}"
        )
    return earlier[-1]


def go_back(settings: Settings, snapshot: Snapshot, told: Callable[[str], None]) -> Path:
    """Put a snapshot in the place of the database; return where the database of before was set aside.

    The snapshot is copied, brought to the newest revision and the ledger of erasures carried out in it before
    anything is moved, so that nothing is changed where any of it fails.

    Raises
    ------
    InputError
        Another program has the database open, or there is no room for the copy.
    """
    path = database_file(settings)
    before = aside(path, now())
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
