"""What snapshots ask of SQLite itself: a copy, one file without a WAL, a database that nobody else uses."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from experiments.errors import InputError


def copied(source: Path, target: Path) -> str:
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
                f"another program has {path} open ({error}); stop the server first, nothing was changed"
            ) from error
        except sqlite3.DatabaseError:
            pass
        yield
