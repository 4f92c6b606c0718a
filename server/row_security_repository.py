"""The second wall between laboratories: on PostgreSQL a member's transactions see her own studies' rows.

Every transaction of a request that an account was recognised for runs in a role that owns no table, and the
tables' policies (`server.row_policies_repository`) let that role at rows of her workspaces' and grants'
studies. Who calls whom does not matter: an endpoint that forgets to ask whose a study is finds nothing.
Participants, the command line and the server's own work are nobody's requests and run as the owner of the
tables.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from sqlalchemy import Connection, event
from sqlalchemy.orm import Session, SessionTransaction

ROLE = "palpebra_member"
"""The role of members' transactions: it can sign in nowhere and owns nothing."""
ACCOUNT = "palpebra.account"
"""The setting that says whose transaction it is."""
_OWNER_AGAIN = "SET LOCAL ROLE NONE"


@dataclass
class Acting:
    """For whom a request acts, once that is known; its threads share it.

    Attributes
    ----------
    account_id : int or None
        None before an account was recognised.
    """

    account_id: int | None = None


_acting: ContextVar[Acting | None] = ContextVar("acting", default=None)


@contextmanager
def acting() -> Iterator[None]:
    """What is within is one request: it acts for nobody until an account is recognised."""
    before = _acting.set(Acting())
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


def _narrow(_session: Session, _transaction: SessionTransaction, connection: Connection) -> None:
    request = _acting.get()
    if request is not None and request.account_id is not None:
        connection.exec_driver_sql(_narrowing(request.account_id))


event.listen(NarrowedSession, "after_begin", _narrow)


def _narrowing(account_id: int) -> str:
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
    session.connection().exec_driver_sql(_narrowing(request.account_id))


def kind_of_session(narrows: bool) -> type[Session]:
    """The class of a database's sessions, by whether it keeps rows apart."""
    return NarrowedSession if narrows else Session
