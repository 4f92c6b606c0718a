"""NOTIFY and LISTEN, by which the processes on one PostgreSQL tell one another that they wrote."""

from collections.abc import Iterator

import psycopg
from sqlalchemy import text

from server.db import Database, kept_alive

_CHANNEL = "palpebra_changes"


def say_changed(database: Database) -> None:
    """Tell every process that listens, this one too."""
    with database.engine.connect() as connection:
        connection.execute(text(f"NOTIFY {_CHANNEL}"))
        connection.commit()


def heard_changes(database: Database, look_s: float) -> Iterator[int]:
    """How many were told since the last time, every `look_s`, once it listens: 0 at first.

    Where the connection is cut, or there is none, psycopg's error is raised.
    """
    address = kept_alive(database.url).set(drivername="postgresql")
    url = address.render_as_string(hide_password=False)
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute(f"LISTEN {_CHANNEL}")
        yield 0
        while True:
            yield sum(1 for _ in connection.notifies(timeout=look_s))
