import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import inspect, text

from experiments.ratings import COLUMN_NAMES
from server.db import Database
from server.migrate import current_revision, downgrade, newest_revision, upgrade
from server.models import Base
from tests.helpers.databases import BACKENDS

both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)


@both
def test_the_migrations_make_what_the_models_declare(empty_database_url: str) -> None:
    database = Database(empty_database_url)
    assert upgrade(database) == (None, newest_revision())
    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
        assert tuple(connection.execute(text("SELECT * FROM ratings")).keys()) == COLUMN_NAMES
    database.close()


@both
def test_down_to_nothing_and_up_again(empty_database_url: str) -> None:
    database = Database(empty_database_url)
    upgrade(database)
    downgrade(database, "base")
    assert current_revision(database) is None
    assert set(inspect(database.engine).get_table_names()) <= {"alembic_version"}
    assert upgrade(database) == (None, newest_revision())
    assert upgrade(database) == (newest_revision(), newest_revision())
    database.close()


def test_sqlite_writes_ahead_and_waits_for_the_disk(tmp_path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'x.sqlite'}")
    with database.read() as session:
        assert session.scalar(text("PRAGMA journal_mode")) == "wal"
        assert session.scalar(text("PRAGMA synchronous")) == 2
        assert session.scalar(text("PRAGMA foreign_keys")) == 1
    database.close()
