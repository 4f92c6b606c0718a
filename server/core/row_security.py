"""The second wall between laboratories on PostgreSQL: members' transactions see their own studies' rows."""

import hashlib
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from sqlalchemy import Connection, event, inspect, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session, SessionTransaction

from experiments.errors import InputError
from experiments.kinds import views
from server.models.base import Base

# The second wall between laboratories: on PostgreSQL a member's transactions see her own studies' rows.
#
# Every transaction of a request that an account was recognized for runs in a role that owns no table, and the
# tables' policies (`server.core.row_security`) let that role at rows of her workspaces' and grants'
# studies. Who calls whom does not matter: an endpoint that forgets to ask whose a study is finds nothing.
# Participants, the command line and the server's own work are nobody's requests and run as the owner of the
# tables.

ROLE = "palpebra_member"
"""The role of members' transactions: it can sign in nowhere and owns nothing."""
ACCOUNT = "palpebra.account"
"""The setting that says whose transaction it is."""
_OWNER_AGAIN = "SET LOCAL ROLE NONE"


@dataclass
class ActingAccount:
    """For whom a request acts, once that is known; its threads share it.

    Attributes
    ----------
    account_id : int or None
        None before an account was recognized.
    """

    account_id: int | None = None


_acting: ContextVar[ActingAccount | None] = ContextVar("acting", default=None)


@contextmanager
def request_scope() -> Iterator[None]:
    """What is within is one request: it acts for nobody until an account is recognised."""
    before = _acting.set(ActingAccount())
    try:
        yield
    finally:
        _acting.reset(before)


def act_for(account_id: int) -> None:
    """From here on this request's transactions see what this account may; outside of one nothing changes."""
    if (request := _acting.get()) is not None:
        request.account_id = account_id


class NarrowedSession(Session):
    """A session whose transactions are a member's where the request is."""


def _narrow_transaction(_session: Session, _transaction: SessionTransaction, connection: Connection) -> None:
    request = _acting.get()
    if request is not None and request.account_id is not None:
        connection.exec_driver_sql(_narrowing_statement(request.account_id))


event.listen(NarrowedSession, "after_begin", _narrow_transaction)


def _narrowing_statement(account_id: int) -> str:
    # Two statements in one message: each transaction of a member waits for the database once more, not twice.
    return f"SET LOCAL {ACCOUNT} = '{int(account_id)}'; SET LOCAL ROLE {ROLE}"


@contextmanager
def every_row(session: Session) -> Iterator[None]:
    """See the rows of every laboratory for a while: whether a name is taken, how many studies there are.

    What is read so must not be shown.
    """
    request = _acting.get()
    if not isinstance(session, NarrowedSession) or request is None or request.account_id is None:
        yield
        return
    session.flush()
    session.connection().exec_driver_sql(_OWNER_AGAIN)
    yield
    # Not where an error leaves the block: the transaction it broke takes no statement, and is rolled back.
    session.flush()
    session.connection().exec_driver_sql(_narrowing_statement(request.account_id))


def kind_of_session(narrows: bool) -> type[Session]:
    """The class of a database's sessions, by whether it keeps rows apart."""
    return NarrowedSession if narrows else Session


# Policies of rows (`server.core.row_security`): made where PostgreSQL and its user allow it.
#
# They are not a separate migration: whether the database's user may have the role changes from place to
# place, and every migration that touches a table would meet them. Each upgrade takes them down and makes
# them again.

LOG = logging.getLogger(__name__)
NO_RIGHT = "42501"
"""PostgreSQL's code where a user may not do what was asked."""
OWN_TABLES = (
    "make the user of DATABASE_URL the owner of its tables and views (ALTER TABLE ... OWNER TO, or "
    "REASSIGN OWNED), "
    "then run: server database upgrade"
)
OLDEST_POSTGRES = 150_000
"""Before, a view always reads as its owner, and all rows."""
NOT_OF_A_STUDY = frozenset(
    (
        "accounts", "account_logins", "admin_sessions", "api_tokens", "audit_entries", "clips", "invitations",
        "login_attempts", "mailed_links", "shared_counts", "workspace_members", "workspaces",
    )
)  # fmt: skip
"""Tables that belong to no study. Clips are shared by studies, and known by the hash of their bytes."""
_OWN = "study_id = ANY ((SELECT palpebra_studies())::integer[])"
_PARENTS = {
    "study_run_id": "study_runs",
    "link_id": "links",
    "version_id": "study_versions",
    "view": "views",
}
"""Column -> the table whose rows it names: a row may be seen where its parent may."""
_SPECIAL = {
    "studies": "workspace_id = ANY ((SELECT palpebra_workspaces())::integer[]) "
    "OR id = ANY ((SELECT palpebra_granted())::integer[])",
    "jobs": f"study_id IS NULL OR {_OWN}",
    "study_grants": f"account_id = palpebra_account() OR {_OWN}",
}
_ME = f"nullif(current_setting('{ACCOUNT}', true), '')::integer"
_MINE = "SELECT workspace_id FROM workspace_members WHERE account_id = palpebra_account()"
_GRANTED = "SELECT study_id FROM study_grants WHERE account_id = palpebra_account()"
_STUDIES = f"SELECT id FROM studies WHERE workspace_id IN ({_MINE}) OR id IN ({_GRANTED})"  # noqa: S608 - our words
_FUNCTIONS = {
    "palpebra_account": ("integer", f"SELECT {_ME}"),
    "palpebra_workspaces": ("integer[]", f"SELECT ARRAY({_MINE})"),
    "palpebra_granted": ("integer[]", f"SELECT ARRAY({_GRANTED})"),
    "palpebra_studies": ("integer[]", f"SELECT ARRAY({_STUDIES})"),
}
_POLICY = "palpebra_own_studies"


def tables_apart() -> dict[str, str]:
    """Table -> which of its rows a member may see and change."""
    return {
        name: _SPECIAL.get(name) or _condition(name, set(table.columns.keys()))
        for name, table in Base.metadata.tables.items()
        if name not in NOT_OF_A_STUDY
    }


def _condition(name: str, columns: set[str]) -> str:
    if "study_id" in columns:
        return _OWN
    parents = [
        # The parent's own policy decides: it is asked as the member too.
        f"EXISTS (SELECT 1 FROM {parent} WHERE {parent}.id = {name}.{column})"  # noqa: S608 - our words
        for column, parent in _PARENTS.items()
        if column in columns
    ]
    if not parents:
        raise RuntimeError(f"specify in {__name__} to which study a row of the table {name} belongs")
    return " OR ".join(parents)


# Decision 0782: Row-level security as a second wall.
def raise_wall(connection: Connection, *, stood: bool = False) -> bool:
    """Make the policies unless they are as they should be; False where the user or PostgreSQL lets none be.

    Parameters
    ----------
    stood : bool
        Whether policies were taken down before, in this transaction: then there shall be some again.

    Raises
    ------
    InputError
        Policies existed, and this user may not create them again.
    """
    stood = stood or _mark(connection) is not None
    if not _role_is_ours(connection):
        return False
    statements = list(_statements(_schema(connection), _sequences(connection)))
    mark = hashlib.sha256("\n".join(statements).encode()).hexdigest()
    if _mark(connection) == mark and _is_whole(connection):
        return True
    statements.append(f"COMMENT ON FUNCTION palpebra_account() IS '{mark}'")
    return _carry_out_all(connection, statements, stood)


def _carry_out_all(connection: Connection, statements: list[str], stood: bool) -> bool:
    """Whether the statements could be carried out, all or none; an earlier wall is not left half-built."""
    try:
        with connection.begin_nested():
            take_down_wall(connection)
            for statement in statements:
                connection.exec_driver_sql(statement)
    except DBAPIError as error:
        if getattr(error.orig, "sqlstate", None) != NO_RIGHT:
            raise
        said = str(error.orig).splitlines()[0]
        if stood:
            raise InputError(f"rows are separated as in an earlier version: {said}; {OWN_TABLES}") from error
        LOG.warning("PostgreSQL does not separate the rows of workspaces: %s; %s", said, OWN_TABLES)
        return False
    return True


def _statements(schema: str, sequences: list[str]) -> Iterator[str]:
    for name, (gives, body) in _FUNCTIONS.items():
        yield (
            f"CREATE FUNCTION {name}() RETURNS {gives} LANGUAGE sql STABLE SECURITY DEFINER "
            f"SET search_path = {schema}, pg_temp AS $palpebra$ {body} $palpebra$"
        )
    yield f"GRANT USAGE ON SCHEMA {schema} TO {ROLE}"
    yield f"GRANT SELECT, INSERT, UPDATE, DELETE ON {', '.join(Base.metadata.tables)} TO {ROLE}"
    if sequences:  # none are a user's who does not own the tables
        yield f"GRANT USAGE ON SEQUENCE {', '.join(sequences)} TO {ROLE}"
    for view in views():
        yield f"ALTER VIEW {view.name} SET (security_invoker = true)"
        yield f"GRANT SELECT ON {view.name} TO {ROLE}"
    for table, condition in tables_apart().items():
        yield f"ALTER TABLE {table} ENABLE ROW LEVEL SECURITY"
        yield f"CREATE POLICY {_POLICY} ON {table} TO {ROLE} USING ({condition})"


def take_down_wall(connection: Connection) -> bool:
    """Remove the policies, so that tables can be changed; whether there were any.

    The role, which is the whole cluster's, stays.
    """
    if _mark(connection) is None:
        return False
    on = text(
        "SELECT quote_ident(tablename) FROM pg_policies "
        "WHERE policyname = :name AND schemaname = current_schema()"
    )
    for table in connection.scalars(on, {"name": _POLICY}).all():
        connection.exec_driver_sql(f"DROP POLICY {_POLICY} ON {table}")
        connection.exec_driver_sql(f"ALTER TABLE {table} DISABLE ROW LEVEL SECURITY")
    for view in inspect(connection).get_view_names():
        if view in {one.name for one in views()}:
            connection.exec_driver_sql(f"ALTER VIEW {view} RESET (security_invoker)")
    connection.exec_driver_sql(f"REVOKE ALL ON SCHEMA {_schema(connection)} FROM {ROLE}")
    for table in inspect(connection).get_table_names():
        connection.exec_driver_sql(f"REVOKE ALL ON {table} FROM {ROLE}")
    for sequence in _sequences(connection):
        connection.exec_driver_sql(f"REVOKE ALL ON SEQUENCE {sequence} FROM {ROLE}")
    for name in _FUNCTIONS:
        connection.exec_driver_sql(f"DROP FUNCTION {name}()")
    return True


def wall_stands(connection: Connection) -> bool:
    """Whether members' transactions can be narrowed: the policies are there and the role may be taken."""
    return _mark(connection) is not None and _may_take_role(connection)


def _mark(connection: Connection) -> str | None:
    """What the wall was made of; None where there is none."""
    query = "SELECT obj_description(to_regprocedure('palpebra_account()'), 'pg_proc')"
    mark: str | None = connection.scalar(text(query))
    return mark


def _is_whole(connection: Connection) -> bool:
    """Whether policies and rights exist, too: a dump brings the mark alone to where the role was missing."""
    query = text(
        "SELECT (SELECT count(*) FROM pg_policies "
        "WHERE policyname = :name AND schemaname = current_schema()), "
        "has_schema_privilege(:role, current_schema(), 'USAGE'), "
        "has_table_privilege(:role, 'studies', 'SELECT')"
    )
    policies, *rights = connection.execute(query, {"name": _POLICY, "role": ROLE}).one()
    return policies == len(tables_apart()) and all(rights)


def _schema(connection: Connection) -> str:
    return str(connection.scalar(text("SELECT quote_ident(current_schema())")))


def _sequences(connection: Connection) -> list[str]:
    query = (
        "SELECT quote_ident(sequencename) FROM pg_sequences "
        "WHERE schemaname = current_schema() AND sequenceowner = current_user ORDER BY sequencename"
    )
    return list(connection.scalars(text(query)))


def _version(connection: Connection) -> int:
    return int(connection.scalar(text("SELECT current_setting('server_version_num')")) or 0)


def _role_is_ours(connection: Connection) -> bool:
    """Make the role where it is missing and may be made; whether this user can take it."""
    if _version(connection) < OLDEST_POSTGRES:
        return False
    if not connection.scalar(text("SELECT count(*) FROM pg_roles WHERE rolname = :role"), {"role": ROLE}):
        _try_statement(connection, f"CREATE ROLE {ROLE} NOLOGIN")
    if not _may_take_role(connection):
        how = " WITH SET TRUE, INHERIT FALSE" if _version(connection) >= 160_000 else ""
        _try_statement(connection, f"GRANT {ROLE} TO CURRENT_USER{how}")
    return _may_take_role(connection)


def _may_take_role(connection: Connection) -> bool:
    right = "SET" if _version(connection) >= 160_000 else "MEMBER"
    query = text("SELECT pg_has_role(current_user, oid, :right) FROM pg_roles WHERE rolname = :role")
    return bool(connection.scalar(query, {"right": right, "role": ROLE}))


def _try_statement(connection: Connection, statement: str) -> None:
    """Run a statement; skip it if this user may not run it, or another did at the same moment."""
    try:
        with connection.begin_nested():
            connection.exec_driver_sql(statement)
    except DBAPIError as error:
        if error.connection_invalidated:
            raise
