"""What Alembic runs: the migrations on the connection it was given, or on the database of the settings."""

from typing import Literal

from alembic import context
from sqlalchemy import Connection

from server.core.db import open_database
from server.core.migrate import derived_anew, migration_transaction, refuse_without_views
from server.core.repository import stored_revision
from server.core.settings import Settings
from server.models import Base, UtcDateTime


def render_item(kind: str, item: object, _context: object) -> str | Literal[False]:
    # A migration must not change when the program's own column type does.
    return "sa.DateTime(timezone=True)" if kind == "type" and isinstance(item, UtcDateTime) else False


def migrate(connection: Connection) -> None:
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_as_batch=connection.dialect.name == "sqlite",
        compare_type=True,
        render_item=render_item,
    )
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    migrate(given)
else:
    database = open_database(Settings())
    context.config.attributes["secret_key"] = database.secret_key
    with migration_transaction(database) as connection:
        before = stored_revision(connection)
        with derived_anew(connection):
            migrate(connection)
        refuse_without_views(before, stored_revision(connection))
    database.close()
