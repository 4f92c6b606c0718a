"""The audit log: one row for every change an experimenter makes, and for every look at single persons."""

from typing import Any, Literal

from sqlalchemy.orm import Session

from server.accounts.identity import OPERATOR, Identity, Operator
from server.audit import repository
from server.audit.sealing import join_at_commit
from server.clock import now
from server.models import AuditEntry

NOBODY: Literal["nobody"] = "nobody"
"""The actor where somebody tried and was not recognised."""
SECOND_FACTOR_SET_UP = "second factor set up"
"""The entry that says under which key of the server a second factor is: its own hash is made with it."""


def record(
    session: Session,
    identity: Identity | Operator | Literal["nobody"] | None,
    action: str,
    kind: str = "",
    target: str = "",
    /,
    **details: Any,
) -> None:
    """Add an entry in the caller's transaction, so that a change and its entry stand or fall together.

    Parameters
    ----------
    identity : Identity or Operator or {"nobody"} or None
        None, as OPERATOR, for the command line.
    """
    actor = None if identity == NOBODY else identity or OPERATOR
    entry = AuditEntry(
        at=now(),
        account_id=actor.account_id if actor else None,
        actor=actor.name if actor else NOBODY,
        action=action,
        target_kind=kind,
        target=target[:200],
        details=details,
    )
    session.add(entry)
    join_at_commit(session, entry)


def latest(session: Session, before: int | None, limit: int) -> list[AuditEntry]:
    """The latest entries with a number below `before`, newest first."""
    return repository.latest(session, before, limit)
