"""Bring a database to the newest revision, or tell which one it has."""

from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

import migrations
from server.db import Database

_LOCK = 7_202_611  # any number, the same for every worker


def alembic_config(connection: Connection | None = None) -> Config:
    """Alembic's settings, working on `connection`."""
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    config.set_main_option("path_separator", "os")
    config.attributes["connection"] = connection
    return config


def upgrade(database: Database, revision: str = "head") -> tuple[str | None, str | None]:
    """Run the missing migrations in one transaction; return the revision before and after."""
    with database.engine.execution_options(immediate=True).begin() as connection:
        if not database.is_sqlite:
            # Workers that start together must not migrate together.
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _LOCK})
        before = MigrationContext.configure(connection).get_current_revision()
        command.upgrade(alembic_config(connection), revision)
        after = MigrationContext.configure(connection).get_current_revision()
    return before, after


def downgrade(database: Database, revision: str = "-1") -> None:
    """Undo migrations down to `revision`."""
    with database.engine.execution_options(immediate=True).begin() as connection:
        command.downgrade(alembic_config(connection), revision)


def current_revision(database: Database) -> str | None:
    """The revision of the database; None where it is empty."""
    with database.engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


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
