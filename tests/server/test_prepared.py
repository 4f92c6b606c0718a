"""Prepared statements: the same rows, values and errors as SQLAlchemy's own way, on either database."""

from datetime import UTC, datetime, timedelta, timezone
from typing import Any, NamedTuple

import pytest
from sqlalchemy import bindparam, insert, select, text, update
from sqlalchemy.exc import DBAPIError, IntegrityError

from server.context import Services
from server.core.commit import Prepared, Query
from server.core.db import is_away, is_cut
from server.models import RunEvent

EVENTS = RunEvent.__table__
COLUMNS = ("event_id", "type", "at_client", "received_at", "data")
MOMENT = datetime(2026, 11, 22, 10, 30, 0, 250_000, timezone(timedelta(hours=2)))


class Stored(NamedTuple):
    event_id: str
    at_client: datetime | None
    data: dict[str, Any]


ADD = Prepared(insert(EVENTS).inline(), COLUMNS)
SELECT = (
    select(*(EVENTS.c[name] for name in Stored._fields))
    .where(EVENTS.c.type == bindparam("kind"), EVENTS.c.event_id != "left out")
    .order_by(EVENTS.c.event_id)
)
READ = Query(SELECT, Stored._make)
RENAME = Prepared(
    update(EVENTS).where(EVENTS.c.event_id == bindparam("known")).values(type=bindparam("kind"))
)


def event(name: str, **values: Any) -> dict[str, Any]:
    data = {"text": "Grüße", "numbers": [1, 2.5, None]}
    return {
        "event_id": name,
        "type": "seen",
        "at_client": None,
        "received_at": MOMENT,
        "data": data,
        **values,
    }


def test_rows_and_values_are_as_sqlalchemy_has_them(services: Services) -> None:
    with services.database.write_connection() as connection:
        for values in (event("b", at_client=MOMENT), event("a"), event("left out")):
            ADD.run(connection, values)
    with services.database.write_connection() as connection:
        rows = READ.all(connection, {"kind": "seen"})
        assert [tuple(row) for row in rows] == [
            tuple(row) for row in connection.execute(SELECT, {"kind": "seen"})
        ]
    assert [row.event_id for row in rows] == ["a", "b"]
    assert (rows[1].at_client, rows[0].at_client) == (MOMENT.astimezone(UTC), None)
    assert rows[0].data == event("a")["data"]


def test_a_statement_is_part_of_the_transaction_also_of_one_that_has_not_begun(services: Services) -> None:
    with services.database.write_engine.connect() as connection:
        ADD.run(connection, event("a"))
        assert connection.in_transaction()
        RENAME.run(connection, {"known": "a", "kind": "renamed"})
        assert READ.one_or_none(connection, {"kind": "renamed"})
        connection.rollback()
        assert READ.one_or_none(connection, {"kind": "renamed"}) is None


def test_errors_are_those_of_sqlalchemy_and_quote_no_values(services: Services) -> None:
    with services.database.write_connection() as connection:
        with pytest.raises(KeyError, match="data"):
            ADD.run(connection, {name: value for name, value in event("a").items() if name != "data"})
        with pytest.raises(IntegrityError) as caught:
            ADD.run(connection, event("a", received_at=None))
        assert "Grüße" not in str(caught.value)
        assert not is_cut(caught.value)
        connection.rollback()


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
def test_a_broken_connection_is_given_up(services: Services) -> None:
    writer = services.database.writer()
    with writer.transaction() as connection:
        process = connection.scalar(text("SELECT pg_backend_pid()"))
    assert writer.is_kept
    with services.database.write_connection() as other:
        other.execute(text("SELECT pg_terminate_backend(:process)"), {"process": process})
    with pytest.raises(DBAPIError) as caught, writer.transaction() as connection:
        ADD.run(connection, event("a"))
    assert is_cut(caught.value)
    assert is_away(caught.value)
    assert not writer.is_kept
    with writer.transaction() as connection:
        ADD.run(connection, event("a"))
    writer.rest()
    with services.database.write_connection() as connection:
        assert len(READ.all(connection, {"kind": "seen"})) == 1
