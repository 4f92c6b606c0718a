import json

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, inspect, select, text

from experiments.columns import Dialect
from experiments.kinds import views
from server.core.db import Database
from server.core.migrate import (
    alembic_config,
    current_revision,
    downgrade,
    known_revision,
    newest_revision,
    upgrade,
)
from server.models import Base, StudyVersion
from tests.helpers.databases import BACKENDS
from tests.helpers.older_databases import load_older_database

both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)


@both
def test_the_migrations_make_what_the_models_declare(empty_database_url: str) -> None:
    database = Database(empty_database_url)
    assert upgrade(database) == (None, newest_revision())
    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    database.close()


def test_the_newest_revision_read_from_the_files_is_that_of_alembic() -> None:
    scripts = ScriptDirectory.from_config(alembic_config())
    assert newest_revision() == scripts.get_current_head()
    assert all(known_revision(script.revision) for script in scripts.walk_revisions())
    assert not known_revision("9999")


@both
def test_the_views_of_the_database_are_those_of_the_columns(empty_database_url: str) -> None:
    database = Database(empty_database_url)
    upgrade(database)
    dialect: Dialect = "sqlite" if database.engine.dialect.name == "sqlite" else "postgresql"
    with database.engine.connect() as connection:
        assert set(inspect(connection).get_view_names()) == {view.name for view in views()}
        for view in views():
            made_by_upgrade = definition_of(connection, view.name)
            connection.execute(text(f"DROP VIEW {view.name}"))
            connection.execute(text(view.create(dialect)))
            assert made_by_upgrade == definition_of(connection, view.name)
            assert tuple(connection.execute(text(f"SELECT * FROM {view.name}")).keys()) == view.names
    database.close()


def definition_of(connection: Connection, view: str) -> str:
    """The view as the database keeps it, blanks aside."""
    query = inspect(connection).get_view_definition(view)
    assert query is not None
    return " ".join(query.split())


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


@both
def test_another_kind_of_trial_is_not_taken_down_to_a_revision_that_does_not_know_it(
    empty_database_url: str,
) -> None:
    database = load_older_database(empty_database_url)
    upgrade(database)
    with database.write() as session:
        version = session.scalars(select(StudyVersion).limit(1)).one()
        version.definition = {**version.definition, "trial": {"kind": "paired_comparison"}}
    with pytest.raises(
        RuntimeError, match="and 1 stored versions of studies have another; keep this"
    ) as raised:
        downgrade(database, "0005")
    assert "\n" not in str(raised.value)
    assert current_revision(database) == newest_revision()
    with database.read() as session:
        stored = set(session.execute(text("SELECT kind, CAST(payload AS text) FROM trial_ratings")).all())
        clips = session.scalar(text("SELECT count(*) FROM trial_clips WHERE role = 'shown'"))
    assert {kind for kind, _ in stored} == {"clip_rating"}
    assert {tuple(json.loads(payload)) for _, payload in stored} == {("response",)}
    assert clips > 20
    database.close()
