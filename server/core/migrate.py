"""Bring a database to the newest revision, or tell which one it has."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

import migrations
from server.core.db import Database
from server.core.repository import wait_for_other_migrations
from server.core.row_security import raise_wall, take_down_wall


def alembic_config(
    connection: Connection | None = None, secret_key: Callable[[], bytes] | None = None
) -> Config:
    """Alembic's settings, working on `connection`; a revision that encrypts asks for the secret key."""
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    config.set_main_option("path_separator", "os")
    config.attributes["connection"] = connection
    config.attributes["secret_key"] = secret_key
    return config


@contextmanager
def migrating(database: Database) -> Iterator[Connection]:
    """A connection whose one transaction holds all migrations: killed half-way, the database is as it was.

    Alembic takes SQLite for a database that commits with each change of a table; begun like this it does not.
    """
    with database.write_engine.begin() as connection:
        if not database.is_sqlite:
            # Workers that start together must not migrate together.
            wait_for_other_migrations(connection)
        yield connection


def upgrade(database: Database, revision: str = "head") -> tuple[str | None, str | None]:
    """Run the missing migrations in one transaction; return the revision before and after."""
    with migrating(database) as connection:
        before = revision_of(connection)
        stood = before != newest_revision() and without_wall(connection)
        command.upgrade(alembic_config(connection, database.secret_key), revision)
        with_wall(connection, stood=stood)
        return before, revision_of(connection)


def without_wall(connection: Connection) -> bool:
    """Take down the policies of rows, which hold on to columns that migrations change; whether any stood."""
    return connection.dialect.name == "postgresql" and take_down_wall(connection)


def with_wall(connection: Connection, *, stood: bool = False) -> None:
    """Put up the policies of rows where the database has the newest revision; `stood` as for `raise_wall`."""
    if connection.dialect.name == "postgresql" and revision_of(connection) == newest_revision():
        raise_wall(connection, stood=stood)


def revision_of(connection: Connection) -> str | None:
    """The revision of a connection's database; None where it is empty."""
    return MigrationContext.configure(connection).get_current_revision()


def downgrade(database: Database, revision: str = "-1") -> None:
    """Undo migrations down to `revision`."""
    with migrating(database) as connection:
        without_wall(connection)
        command.downgrade(alembic_config(connection, database.secret_key), revision)


def current_revision(database: Database) -> str | None:
    """The revision of the database; None where it is empty."""
    with database.engine.connect() as connection:
        return revision_of(connection)


def newest_revision() -> str:
    """The revision this program expects."""
    head = ScriptDirectory.from_config(alembic_config()).get_current_head()
    if head is None:
        raise RuntimeError("expected at least one migration in the folder migrations, found none")
    return head


def known_revision(revision: str) -> bool:
    """True where this program has that revision."""
    scripts = ScriptDirectory.from_config(alembic_config())
    return any(script.revision == revision for script in scripts.walk_revisions())
