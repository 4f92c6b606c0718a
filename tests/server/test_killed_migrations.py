"""`alembic upgrade` killed half-way: nothing is changed, and the next upgrade starts from the beginning."""

import os
import signal
import subprocess
import sys

import pytest
from sqlalchemy import text

from server.core.db import Database
from server.core.migrate import current_revision, newest_revision, upgrade
from server.privacy.rows import Content, content_of, snapshot, tables_of
from tests.conftest import REPOSITORY
from tests.helpers.databases import BACKENDS
from tests.helpers.older_databases import load_older_database, opened

# Dies by its own kill -9 once so many revisions are written, before the transaction ends.
KILLED = """
import os, signal, sys
from alembic.config import main
from sqlalchemy import Engine, event

left = int(sys.argv[1])

@event.listens_for(Engine, "after_cursor_execute")
def count(connection, cursor, statement, *rest):
    global left
    if statement.lstrip().startswith("UPDATE alembic_version"):
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

main(["upgrade", "head"])
"""


def stored(database: Database) -> dict[str, Content]:
    """Every table with the hash of its rows, the revision included."""
    with snapshot(database) as connection:
        return {table.name: content_of(connection, table) for table in tables_of(connection)}


def schema(database: Database) -> set[str]:
    """Every column, and in SQLite the text of every table, view, index and trigger."""
    query = "SELECT table_name || '.' || column_name FROM information_schema.columns"
    if database.is_sqlite:
        query = "SELECT name || coalesce(sql, '') FROM sqlite_master"
    with database.engine.connect() as connection:
        return set(connection.execute(text(query)).scalars())


@pytest.mark.skipif(sys.platform == "win32", reason="kill -9 is a signal of Unix")
@pytest.mark.parametrize("revisions", [1, 5, int(newest_revision()) - 1], ids="after {}".format)
@pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)
def test_a_migration_that_is_killed_changes_nothing_and_starts_again(
    empty_database_url: str, revisions: int
) -> None:
    database = load_older_database(empty_database_url)
    before, tables = stored(database), schema(database)
    assert before["trial_ratings"].rows > 20
    database.close()
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, str(revisions)],
        cwd=REPOSITORY,
        env={**os.environ, "DATABASE_URL": empty_database_url},
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    database = opened(empty_database_url)
    assert current_revision(database) == "0001"
    assert (stored(database), schema(database)) == (before, tables)
    assert upgrade(database) == ("0001", newest_revision())
    with database.read() as session:
        ratings = session.execute(text("SELECT count(*) FROM trial_ratings")).scalar_one()
    assert ratings == before["trial_ratings"].rows
    database.close()
