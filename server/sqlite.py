"""SQLite as SQLAlchemy uses it here: transactions begin as we say, and cost no more than their statement.

The driver's own handling would begin them late, and not for reads. SQLAlchemy's documentation does it by an
event of the engine; an engine with events looks for listeners around every statement, which takes longer than
most of them.
"""

from typing import Any

from sqlalchemy import create_engine, event
from sqlalchemy.dialects import registry
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.engine import URL, Engine
from sqlalchemy.pool import Pool


class Reading(SQLiteDialect_pysqlite):
    """Transactions see one moment of the file from their first query on."""

    supports_statement_cache = True
    begins = "BEGIN"

    def do_begin(self, dbapi_connection: Any) -> None:
        """Begin a transaction."""
        dbapi_connection.cursor().execute(self.begins)


class Writing(Reading):
    """What reads before it writes must hold the write lock from its start, or it may have to fail."""

    supports_statement_cache = True
    begins = "BEGIN IMMEDIATE"


for _dialect in (Reading, Writing):
    registry.register(f"sqlite.{_dialect.__name__.lower()}", __name__, _dialect.__name__)


def sqlite_engines(url: URL, pool: int, busy_s: float, pool_timeout_s: float) -> tuple[Engine, Engine]:
    """Engines that read and that write, which share their connections."""
    reading = create_engine(
        url.set(drivername="sqlite+reading"),
        pool_size=pool,
        max_overflow=2 * pool,
        pool_timeout=pool_timeout_s,
        hide_parameters=True,  # an error must not quote what a person answered
        connect_args={"timeout": busy_s, "check_same_thread": False},
    )
    event.listen(reading, "connect", _prepare)
    return reading, _writing(url, reading.pool)


def _writing(url: URL, pool: Pool) -> Engine:
    return create_engine(url.set(drivername="sqlite+writing"), pool=pool, hide_parameters=True)


def _lower(text: Any) -> Any:
    """As PostgreSQL and Python fold it: SQLite's own leaves every letter but those of ASCII as it is.

    No index and no constraint is on lower(): programs without this function read the same file.
    """
    return text.lower() if isinstance(text, str) else text


def _prepare(connection: Any, _record: object) -> None:
    connection.isolation_level = None  # the driver begins nothing
    connection.create_function("lower", 1, _lower, deterministic=True)
    cursor = connection.cursor()
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "temp_store=MEMORY"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()
