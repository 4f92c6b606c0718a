"""Bring a database to the newest revision, or report which one it has.

Alembic is imported where something is migrated: loading it takes a tenth of the time of a start.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection

import migrations
from server.core.database_views import drop_views, make_views, refusals_in_one_line, views_are_current
from server.core.db import Database
from server.core.repository import stored_revision, wait_for_other_migrations
from server.core.row_security import raise_wall, take_down_wall

if TYPE_CHECKING:
    from alembic.config import Config

FIRST_WITH_DERIVED_VIEWS = "0033"
"""From here on programs make their views themselves; those of earlier revisions had migrations for that."""


def alembic_config(
    connection: Connection | None = None, secret_key: Callable[[], bytes] | None = None
) -> "Config":
    """Alembic's settings, working on `connection`; a revision that encrypts asks for the secret key."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    config.set_main_option("path_separator", "os")
    config.attributes["connection"] = connection
    config.attributes["secret_key"] = secret_key
    return config


@contextmanager
def migration_transaction(database: Database) -> Iterator[Connection]:
    """A connection whose one transaction holds all migrations: killed half-way, the database is as it was.

    Alembic takes SQLite for a database that commits with each change of a table; begun like this it does not.
    """
    with database.write_engine.begin() as connection:
        if not database.is_sqlite:
            # Workers that start together must not migrate together.
            wait_for_other_migrations(connection)
        yield connection


def upgrade(database: Database) -> tuple[str | None, str | None]:
    """Run the missing migrations in one transaction; return the revision before and after.

    Views that differ from this program's columns are created again, with no new revision too.
    """
    with migration_transaction(database) as connection:
        before = stored_revision(connection)
        if before == newest_revision() and views_are_current(connection):
            _raise_wall_at_newest(connection)
            return before, before
        from alembic import command

        with derived_anew(connection):
            command.upgrade(alembic_config(connection, database.secret_key), "head")
        return before, stored_revision(connection)


@contextmanager
def derived_anew(connection: Connection) -> Iterator[None]:
    """Tables may be changed within: views and policies of rows hold on to columns, and are made after it.

    They fit the newest revision alone; a database that is left at another one has none.
    """
    with refusals_in_one_line():
        stood = connection.dialect.name == "postgresql" and take_down_wall(connection)
        dropped = drop_views(connection)
    yield
    if stored_revision(connection) == newest_revision():
        make_views(connection, dropped)
    _raise_wall_at_newest(connection, stood=stood)


def _raise_wall_at_newest(connection: Connection, *, stood: bool = False) -> None:
    if connection.dialect.name == "postgresql" and stored_revision(connection) == newest_revision():
        raise_wall(connection, stood=stood)


def is_up_to_date(database: Database) -> bool:
    """Whether an upgrade would change nothing: the newest revision, with the views of this program."""
    with database.engine.connect() as connection:
        return stored_revision(connection) == newest_revision() and views_are_current(connection)


def downgrade(database: Database, revision: str = "-1") -> None:
    """Undo migrations down to `revision`, which leaves no views (`refuse_without_views` says how far)."""
    from alembic import command

    with migration_transaction(database) as connection, derived_anew(connection):
        command.downgrade(alembic_config(connection, database.secret_key), revision)


def refuse_without_views(before: str | None, after: str | None) -> None:
    """Refuse a way down to a revision whose programs made their views by migrations, which are gone."""
    from alembic.util import CommandError

    if before is not None and after is not None and after < before and after < FIRST_WITH_DERIVED_VIEWS:
        raise CommandError(
            f"programs of revision {after} need views that this program cannot create; use revision "
            f"{FIRST_WITH_DERIVED_VIEWS} or newer, or restore an old backup with the old program"
        )


def current_revision(database: Database) -> str | None:
    """The revision of the database; None where it is empty."""
    with database.engine.connect() as connection:
        return stored_revision(connection)


@cache
def _known_revisions() -> tuple[frozenset[str], str]:
    """Every revision of this program, and the newest, on which no other builds."""
    files = (Path(migrations.__file__).parent / "versions").glob("*.py")
    texts = [path.read_text(encoding="utf-8") for path in files]
    known, built_on = (
        {revision for text in texts for revision in re.findall(rf'^{name} = "(\w+)"', text, re.MULTILINE)}
        for name in ("revision", "down_revision")
    )
    heads = sorted(known - built_on)
    if len(heads) != 1:
        raise RuntimeError(f"expected one newest migration, found {', '.join(heads) or 'none'}")
    return frozenset(known), heads[0]


def newest_revision() -> str:
    """The revision this program expects."""
    return _known_revisions()[1]


def known_revision(revision: str) -> bool:
    """True where this program has that revision."""
    return revision in _known_revisions()[0]
