"""The database: one code path for SQLite and PostgreSQL, and where transactions begin and end."""

import sqlite3
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import cached_property
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, create_engine, event
from sqlalchemy.dialects import registry
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.engine import URL, Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm import Session
from sqlalchemy.pool import Pool

from experiments.errors import InputError
from server.core.row_security import kind_of_session, wall_stands
from server.core.settings import Settings

# SQLite as SQLAlchemy uses it here: transactions begin as we say, and cost no more than their statement.
#
# The driver's own handling would begin them late, and not for reads. SQLAlchemy's documentation does it by
# an event of the engine; an engine with events looks for listeners around every statement, which takes
# longer than most of them.


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


# The database: one code path for SQLite and PostgreSQL, and where transactions begin and end.

DRIVERS = ("sqlite", "sqlite+pysqlite", "postgresql+psycopg")
SIGNING_KEY, SYSLOG = "signing key", "syslog"
"""What sessions carry: a function that gives the secret key, and where the audit log goes."""
BUSY_TIMEOUT_S = 30
"""How long a command waits for a turn to write."""
REQUEST_BUSY_S = 4
"""How long a request does: twice this, in the queue and at the file, is less than the 10 s pages wait."""
ALIVE = {
    "connect_timeout": "10",
    "keepalives_idle": "20",
    "keepalives_interval": "10",
    "keepalives_count": "3",
    "tcp_user_timeout": "30000",
}
"""Options of libpq: if PostgreSQL's host disappears, the connection ends within a minute, not two hours."""
COUNTING_POOL = 2
SQLITE_AWAY = frozenset(
    (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR)
)


class _Turns:
    """One writer at a time; without a turn within `wait_s`, the error is that of an exhausted pool."""

    def __init__(self, wait_s: float) -> None:
        self._lock = threading.Lock()
        self._wait_s = wait_s

    def __enter__(self) -> None:
        if not self._lock.acquire(timeout=self._wait_s):
            raise PoolTimeout(f"the database was busy: no write access within {self._wait_s:g} s")

    def __exit__(self, *_: object) -> None:
        self._lock.release()


class Database:
    """An engine and the two kinds of transaction: `read()` and `write()`.

    One request uses one of them, and it ends before the answer is sent: what is acknowledged is committed.
    """

    def __init__(
        self,
        url: str,
        *,
        pool: int = 20,
        busy_s: float = BUSY_TIMEOUT_S,
        carried: Mapping[str, Any] | None = None,
    ) -> None:
        self.url = checked_url(url)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        self.engine, self.write_engine = (
            sqlite_engines(self.url, pool, busy_s, BUSY_TIMEOUT_S)
            if self.is_sqlite
            else 2 * (_postgres_engine(self.url, pool),)
        )
        # Limits count while a transaction holds a connection of the pool: asked for a second one, a pool that
        # is used up would have all wait for one another.
        self.counting_engine = self.engine if self.is_sqlite else _postgres_engine(self.url, COUNTING_POOL)
        self.carried = dict(carried or {})
        # SQLite lets one writer in and makes the others poll; queueing them here keeps the wait short.
        self._writer = _Turns(busy_s) if self.is_sqlite else nullcontext()

    @cached_property
    def keeps_rows_apart(self) -> bool:
        """Whether what a member asks is narrowed to her laboratories' rows."""
        if self.is_sqlite:
            return False
        with self.engine.connect() as connection:
            return wall_stands(connection)

    @cached_property
    def _session(self) -> type[Session]:
        return kind_of_session(self.keeps_rows_apart)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session that only reads; rolled back at the end."""
        with self._session(self.engine, autoflush=False, info=self.carried) as session:
            yield session

    @contextmanager
    def snapshot(self) -> Iterator[Session]:
        """As `read()`, but seeing one moment of the database, however long it reads."""
        with self._session(self.engine, autoflush=False, info=self.carried) as session:
            if not self.is_sqlite:  # SQLite's transactions are snapshots in themselves
                session.connection(execution_options={"isolation_level": "REPEATABLE READ"})
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session committed at the end, rolled back where an exception leaves the block."""
        with (
            self._writer,
            self._session(self.write_engine, expire_on_commit=False, info=self.carried) as session,
        ):
            yield session
            session.commit()

    @contextmanager
    def write_connection(self) -> Iterator[Connection]:
        """As `write()`, without the ORM's session: for the few statements that run all the time."""
        with self._writer, self.write_engine.begin() as connection:
            yield connection

    def secret_key(self) -> bytes:
        """The installation's key; refused where the database was opened without one."""
        if SIGNING_KEY not in self.carried:
            raise InputError(
                "recruiters' IDs are encrypted with the installation's key, which is missing here; run: "
                "server database upgrade"
            )
        key: bytes = self.carried[SIGNING_KEY]()
        return key

    def writer(self) -> "Writer":
        """Transactions one after the other, for one thread."""
        return Writer(self.write_engine, self._writer)

    def close(self) -> None:
        """Close every pooled connection."""
        self.engine.dispose()
        self.write_engine.dispose()
        self.counting_engine.dispose()


class Writer:
    """Transactions of one thread, on a connection that it keeps from one to the next until it rests.

    Taking a connection from the pool and handing it back takes as long as two statements; PostgreSQL is asked
    each time, besides, whether it is still there.
    """

    def __init__(self, engine: Engine, turns: "_Turns | nullcontext[None]") -> None:
        self._engine, self._turns = engine, turns
        self._connection: Connection | None = None

    @property
    def is_kept(self) -> bool:
        """Whether the next transaction's connection is one that was not looked at again."""
        return self._connection is not None

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """As `Database.write_connection`. One that fails gives its connection back, which may be broken."""
        with self._turns:
            try:
                if self._connection is None:
                    self._connection = self._engine.connect()
                with self._connection.begin():
                    yield self._connection
            except BaseException:
                self.rest()
                raise

    def rest(self) -> None:
        """Give the connection back to the pool."""
        kept, self._connection = self._connection, None
        if kept is not None:
            kept.close()


def checked_url(url: str) -> URL:
    """The address of a database that this program can use; InputError, without password, for others."""
    expected = (
        "expected DATABASE_URL as postgresql://user:password@host/name or sqlite:///path/to/file, "
        "or empty for SQLite in the data folder"
    )
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError) as error:
        raise InputError(f"{expected}; got an invalid URL") from error
    if parsed.drivername not in DRIVERS:
        raise InputError(f"{expected}; got a URL that begins with '{parsed.drivername}:'")
    if parsed.drivername.startswith("postgresql") and not parsed.database:
        raise InputError(f"{expected}; got a URL without a database name after the host")
    return parsed


def is_away(error: BaseException) -> bool:
    """True where the database was away, had no connection left or put another first: try again."""
    if isinstance(error, PoolTimeout):
        return True
    if not isinstance(error, DBAPIError):
        return False
    # By its attribute, because psycopg is not installed where only SQLite is used.
    cause = error.orig
    if isinstance(error, OperationalError) and cause is not None and hasattr(cause, "sqlstate"):
        # No code: no connection. Classes 08, 53, 57: connection broken, no resources, server shutting down;
        # 40: rolled back for the sake of another transaction.
        code: str | None = cause.sqlstate
        return code is None or code[:2] in ("08", "40", "53", "57")
    return error.connection_invalidated or _sqlite_code(error) in SQLITE_AWAY


def is_cut(error: BaseException) -> bool:
    """True where the connection to the database was found broken."""
    return isinstance(error, DBAPIError) and error.connection_invalidated


def is_busy(error: BaseException) -> bool:
    """True where the database is there, and another program or request has kept it for too long."""
    if isinstance(error, PoolTimeout):
        return True
    return isinstance(error, DBAPIError) and _sqlite_code(error) == sqlite3.SQLITE_BUSY


def _sqlite_code(error: DBAPIError) -> int:
    # Extended codes, such as SQLITE_BUSY_SNAPSHOT, have the primary one in their lowest byte.
    return int(getattr(error.orig, "sqlite_errorcode", -1)) & 0xFF


def open_database(settings: Settings, busy_s: float = BUSY_TIMEOUT_S) -> Database:
    """The database of these settings; the folder of a SQLite file is made."""
    url = checked_url(settings.resolved_database_url)
    if url.get_backend_name() == "sqlite" and url.database:
        Path(url.database).parent.mkdir(parents=True, exist_ok=True)
    return Database(
        settings.resolved_database_url,
        pool=settings.database_pool,
        busy_s=busy_s,
        # The key is read when it is needed: a restore brings it.
        carried={SIGNING_KEY: lambda: settings.key, SYSLOG: settings.audit_syslog},
    )


def kept_alive(url: URL) -> URL:
    """The address of a PostgreSQL whose silence is noticed soon; what it says of that itself goes first."""
    return url.set(query={**ALIVE, **url.query})


def _postgres_engine(url: URL, pool: int) -> Engine:
    return create_engine(
        kept_alive(url),
        pool_size=pool,
        max_overflow=pool,
        pool_timeout=BUSY_TIMEOUT_S,
        pool_pre_ping=True,
        hide_parameters=True,  # an error must not quote what a person answered
    )
