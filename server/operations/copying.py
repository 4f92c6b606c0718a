"""`server database copy`: every row of one database into another, compared afterwards."""

from collections.abc import Callable

from sqlalchemy import make_url
from sqlalchemy.exc import OperationalError

from experiments.errors import InputError
from server.db import Database
from server.migrate import current_revision, newest_revision, upgrade
from server.operations.rows import Content
from server.operations.rows_repository import (
    content_of,
    read_rows,
    refuse_unless_empty,
    snapshot,
    tables_of,
    write_rows,
)
from server.settings import Settings


def copy_database(
    source_url: str, target_url: str, told: Callable[[str, Content], None] = lambda _name, _content: None
) -> dict[str, Content]:
    """Copy all tables; return what each holds, the same in both.

    The target is migrated and must be empty. All rows are written in one transaction, read back and compared
    before it is committed: where anything differs nothing is left behind.

    Raises
    ------
    InputError
        A database cannot be opened, the source is not of the newest revision, the target is not empty, or
        what was read back differs from what was written.
    """
    source, target = _opened(source_url), _opened(target_url)
    try:
        if source.url == target.url:
            raise InputError("source and target are the same database; give two addresses")
        _check_revision(source)
        upgrade(target)
        return _copy(source, target, told)
    finally:
        source.close()
        target.close()


def _copy(source: Database, target: Database, told: Callable[[str, Content], None]) -> dict[str, Content]:
    copied: dict[str, Content] = {}
    with snapshot(source) as reading, target.write_connection() as writing:
        refuse_unless_empty(writing, address(target.url.render_as_string()), "give an empty database")
        into = {table.name: table for table in tables_of(writing)}
        for table in tables_of(reading):
            written = write_rows(writing, into[table.name], read_rows(reading, table))
            content = content_of(writing, into[table.name])
            if content != written:
                raise InputError(
                    f"table {table.name}: {written.rows} rows were written, {content.rows} were read back or "
                    "their values differ; nothing was kept, please report this"
                )
            copied[table.name] = content
            told(table.name, content)
    return copied


def address(url: str) -> str:
    """An address without its password."""
    return make_url(url).render_as_string(hide_password=True)


def _opened(url: str) -> Database:
    try:
        return Database(Settings(database_url=url).resolved_database_url, pool=2)
    except Exception as error:
        raise InputError(
            f"expected an address such as sqlite:///palpebra.sqlite or postgresql://me@host/name, got '{url}'"
        ) from error


def _check_revision(source: Database) -> None:
    try:
        revision, expected = current_revision(source), newest_revision()
    except OperationalError as error:
        reason = str(error.orig).strip().splitlines()[0]
        raise InputError(f"cannot open {address(source.url.render_as_string())}: {reason}") from error
    if revision != expected:
        raise InputError(
            f"the source has revision {revision}, expected {expected}; "
            "run `server database upgrade` with DATABASE_URL set to it first"
        )
