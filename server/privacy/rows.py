"""A database's rows in a form of neither SQLite nor PostgreSQL, read and written whole."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from typing import Any

from sqlalchemy import JSON, Connection, DateTime, Integer, MetaData, Table, func, insert, select, text

from experiments.errors import InputError
from server.core.db import Database
from server.core.values import storable_value

# Rows in a form of neither SQLite nor PostgreSQL: for copies, backups and their comparison.
#
# Values are those of JSON; times are ISO 8601 in UTC.

Row = dict[str, Any]


@dataclass(frozen=True)
class Content:
    """What a table holds: number of rows, and SHA-256 over all of them in order of their key."""

    rows: int
    sha256: str


class Digest:
    """Count and hash of rows as they pass; the order of names in a JSON value does not matter."""

    def __init__(self) -> None:
        self._rows, self._hash = 0, hashlib.sha256()

    def add(self, row: Row) -> None:
        """Take in one row."""
        self._rows += 1
        self._hash.update(json.dumps(row, sort_keys=True, ensure_ascii=False).encode() + b"\n")

    def content(self) -> Content:
        """What has passed so far."""
        return Content(self._rows, self._hash.hexdigest())


def time_text(value: datetime | None) -> str | None:
    """A time as a row has it; SQLite's times have no zone and are in UTC."""
    if value is None:
        return None
    moment = value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    return moment.isoformat(timespec="microseconds")


def time_of(value: str | None, aware: bool) -> datetime | None:
    """The time behind `time_text`, with its zone where the database keeps zones."""
    if value is None:
        return None
    moment = datetime.fromisoformat(value).astimezone(UTC)
    return moment if aware else moment.replace(tzinfo=None)


# A database's rows, read and written whole.
#
# Tables are read from the database itself, not from the models: one of an older revision is handled too.

BATCH = 500
LEFT_OUT = frozenset(("alembic_version", "shared_counts"))
"""The revision, which is stated separately; limits, which are not data."""


@contextmanager
def snapshot(database: Database) -> Iterator[Connection]:
    """A connection that sees one moment of the database, however long it reads."""
    with database.engine.connect() as connection:
        if not database.is_sqlite:  # SQLite's transactions are snapshots in themselves
            connection = connection.execution_options(isolation_level="REPEATABLE READ")
        yield connection


def tables_of(connection: Connection) -> list[Table]:
    """The tables, each after those it refers to."""
    metadata = MetaData()
    metadata.reflect(connection)
    tables = [table for table in metadata.sorted_tables if table.name not in LEFT_OUT]
    for table in tables:
        for column in table.columns:
            if isinstance(column.type, JSON):
                column.type = JSON(none_as_null=True)
    return tables


def read_rows(connection: Connection, table: Table) -> Iterator[Row]:
    """Every row in order of the primary key, in constant memory; what no file could hold is made visible."""
    query = select(table).order_by(*table.primary_key.columns).execution_options(yield_per=BATCH)
    times = {column.name for column in table.columns if isinstance(column.type, DateTime)}
    for row in connection.execute(query).mappings():
        yield {
            name: time_text(value) if name in times else storable_value(value) for name, value in row.items()
        }


def write_rows(connection: Connection, table: Table, rows: Iterable[Row]) -> Content:
    """Insert rows as `read_rows` gives them; return what was written."""
    digest, left = Digest(), iter(rows)
    times = {column.name for column in table.columns if isinstance(column.type, DateTime)}
    aware = connection.dialect.name == "postgresql"
    while batch := list(islice(left, BATCH)):
        for row in batch:
            digest.add(row)
        connection.execute(
            insert(table),
            [
                {name: time_of(row[name], aware) if name in times else row[name] for name in row}
                for row in batch
            ],
        )
    _next_ids(connection, table)
    return digest.content()


def content_of(connection: Connection, table: Table) -> Content:
    """Count and hash of a table."""
    digest = Digest()
    for row in read_rows(connection, table):
        digest.add(row)
    return digest.content()


def refuse_unless_empty(connection: Connection, what: str, way_out: str) -> None:
    """InputError, with what to do instead, where any table holds a row."""
    for table in tables_of(connection):
        if connection.scalar(select(func.count()).select_from(table)):
            raise InputError(f"{what} already contains rows (table {table.name}); {way_out}")


def _next_ids(connection: Connection, table: Table) -> None:
    """PostgreSQL counts ids by itself and must learn which are taken."""
    if connection.dialect.name != "postgresql" or "id" not in table.columns:
        return
    if isinstance(table.columns["id"].type, Integer):
        highest = connection.scalar(select(func.max(table.columns["id"])))
        if highest is not None:
            statement = text("SELECT setval(pg_get_serial_sequence(:name, 'id'), :highest)")
            connection.execute(statement, {"name": table.name, "highest": highest})
