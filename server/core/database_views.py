"""The database's views: made from the code's columns at every upgrade, never by a migration."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from typing import NamedTuple

from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError

from experiments.columns import Dialect
from experiments.columns.view import MADE_FROM
from experiments.errors import InputError
from experiments.kinds import views
from server.core.row_security import NO_RIGHT, OWN_TABLES, ROLE

# A view is derived, so that a new column needs no migration (decision 0990): whatever is in the database
# is compared with what the code would make, and created again if they differ. What others may do with a view
# is read before the view goes, and given again.

NEEDED_BY_OTHERS = "2BP01"
"""PostgreSQL's code where something else is made of what shall be dropped."""


class Grant(NamedTuple):
    """A right on a view that somebody was given, spelled as GRANT takes it."""

    view: str
    column: str | None
    privilege: str
    grantee: str
    grantable: bool

    @property
    def _right(self) -> str:
        right = f"{self.privilege} ({self.column})" if self.column else self.privilege
        return f"{right} ON {self.view}"

    def give(self) -> str:
        """The statement that gives it."""
        return f"GRANT {self._right} TO {self.grantee}{' WITH GRANT OPTION' if self.grantable else ''}"

    def take(self) -> str:
        """The statement that takes it."""
        return f"REVOKE {self._right} FROM {self.grantee} CASCADE"


@dataclass(frozen=True)
class DroppedViews:
    """What stood before the views were dropped.

    Attributes
    ----------
    names : frozenset of str
        Of the views.
    grants : frozenset of Grant
        What others had on them, or on single columns of them.
    options : tuple of (str, str)
        A view and the options that somebody set on it.
    """

    names: frozenset[str] = frozenset()
    grants: frozenset[Grant] = frozenset()
    options: tuple[tuple[str, str], ...] = ()


def views_are_current(connection: Connection) -> bool:
    """Whether the database's views are those that this program would make."""
    dialect = _dialect(connection)
    expected_marks = {view.name: _statement_mark(view.create(dialect), dialect) for view in views()}
    return _stored_marks(connection) == expected_marks


def drop_views(connection: Connection) -> DroppedViews:
    """Drop every view that this program or an earlier one made, so that tables can be changed."""
    names = frozenset(_stored_marks(connection))
    dropped = DroppedViews(names)
    if names and connection.dialect.name == "postgresql":
        dropped = DroppedViews(names, _grants(connection, names), _options(connection, names))
    for name in sorted(names):
        connection.exec_driver_sql(f"DROP VIEW {_quoted_name(connection, name)}")
    return dropped


def make_views(connection: Connection, dropped: DroppedViews) -> None:
    """Make the views of this program's columns, with what others had on those that stood before."""
    dialect = _dialect(connection)
    for view in views():
        statement = view.create(dialect)
        # Escaped: no colon in a view begins a parameter.
        connection.execute(text(statement.replace(":", r"\:")))
        if dialect == "postgresql":
            connection.exec_driver_sql(
                f"COMMENT ON VIEW {view.name} IS '{_statement_mark(statement, dialect)}'"
            )
    again = dropped.names & {view.name for view in views()}
    if again and dialect == "postgresql":
        _give_back(connection, again, dropped)


def _give_back(connection: Connection, again: frozenset[str], dropped: DroppedViews) -> None:
    columns = {(view.name, None) for view in views()} | {
        (view.name, name) for view in views() for name in view.names
    }
    for view, options in dropped.options:
        if view in again:
            connection.exec_driver_sql(f"ALTER VIEW {view} SET ({options})")
    given = _grants(connection, again)
    # Default privileges give each new view what somebody may have taken from the one before.
    for grant in sorted(given - dropped.grants, key=str):
        connection.exec_driver_sql(grant.take())
    for grant in sorted(dropped.grants - given, key=str):
        if (grant.view, grant.column) in columns:
            connection.exec_driver_sql(grant.give())


def _dialect(connection: Connection) -> Dialect:
    return "sqlite" if connection.dialect.name == "sqlite" else "postgresql"


def _statement_mark(statement: str, dialect: Dialect) -> str:
    """The mark that shows from which statement a view was made.

    SQLite keeps the statement, blanks at its end aside; PostgreSQL writes its own words, and keeps a hash.
    """
    if dialect == "sqlite":
        return statement.rstrip()
    return f"{MADE_FROM} ({sha256(statement.encode()).hexdigest()})"


def _stored_marks(connection: Connection) -> dict[str, str]:
    """The marks of our views: those named so, and those marked so, whose kind may be known no more."""
    query = (
        "SELECT name, sql FROM sqlite_schema WHERE type = 'view'"
        if connection.dialect.name == "sqlite"
        else "SELECT relname, coalesce(obj_description(oid, 'pg_class'), '') FROM pg_class "
        "WHERE relkind = 'v' AND relnamespace = current_schema()::regnamespace"
    )
    ours = {view.name for view in views()}
    return {
        name: mark
        for name, mark in connection.exec_driver_sql(query).all()
        if name in ours or MADE_FROM in mark
    }


def _quoted_name(connection: Connection, name: str) -> str:
    return connection.dialect.identifier_preparer.quote(name)


def _grants(connection: Connection, names: frozenset[str]) -> frozenset[Grant]:
    """What others than the owner may do.

    The role of members is left out: the policies of rows give and take its rights.
    """
    query = text(
        "WITH ours AS (SELECT * FROM pg_class WHERE relkind = 'v' AND relname = ANY(:names) "
        "AND relnamespace = current_schema()::regnamespace), "
        "given AS (SELECT relname, relowner, NULL AS attname, relacl AS acl FROM ours UNION ALL "
        "SELECT relname, relowner, quote_ident(attname), attacl "
        "FROM ours JOIN pg_attribute ON attrelid = ours.oid) "
        "SELECT quote_ident(relname), attname, privilege_type, "
        "CASE grantee WHEN 0 THEN 'PUBLIC' ELSE quote_ident(pg_get_userbyid(grantee)) END, is_grantable "
        "FROM given CROSS JOIN LATERAL aclexplode(acl) WHERE grantee <> relowner"
    )
    rows = connection.execute(query, {"names": list(names)})
    return frozenset(grant for grant in map(Grant._make, rows) if grant.grantee != ROLE)


def _options(connection: Connection, names: frozenset[str]) -> tuple[tuple[str, str], ...]:
    query = text(
        "SELECT relname, array_to_string(reloptions, ', ') FROM pg_class WHERE relkind = 'v' "
        "AND relname = ANY(:names) AND relnamespace = current_schema()::regnamespace "
        "AND reloptions IS NOT NULL ORDER BY relname"
    )
    return tuple((view, options) for view, options in connection.execute(query, {"names": list(names)}))


@contextmanager
def refusals_in_one_line() -> Iterator[None]:
    """InputError where the database's user may not change views, or somebody made others from them."""
    try:
        yield
    except DBAPIError as error:
        code, said = getattr(error.orig, "sqlstate", None), str(error.orig).splitlines()[0]
        if code == NO_RIGHT:
            raise InputError(f"the views do not match this program: {said}; {OWN_TABLES}") from error
        if code == NEEDED_BY_OTHERS:
            # "view lab.means depends on view ratings", a line each
            further = "; ".join(str(error.orig).splitlines()[1:])
            raise InputError(
                f"{said} ({further}); save the definition of dependent objects (\\d+ in psql), drop them, "
                f"run: server database upgrade, and create them again"
            ) from error
        raise
