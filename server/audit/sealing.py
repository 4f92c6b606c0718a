"""Entries join the chain as the last thing before their transaction is committed, one at a time."""

import secrets
from collections.abc import Sequence

from sqlalchemy import event
from sqlalchemy.orm import Session

from server.audit import chain, repository
from server.audit.forwarding import forward
from server.db import SIGNING_KEY, SYSLOG
from server.models import AuditEntry

_WAITING = "audit entries"


def join_at_commit(session: Session, entry: AuditEntry) -> None:
    """Have an entry of this session put into the chain when it is committed.

    Not before: the lock on the chain is then the last that a transaction asks for, so that two cannot wait
    for one another, and is held for the shortest time.
    """
    waiting = session.info.setdefault(_WAITING, [])
    if not waiting:
        event.listen(session, "before_commit", _join, once=True)
    waiting.append(entry)


def _join(session: Session) -> None:
    entries: Sequence[AuditEntry] = session.info.pop(_WAITING, ())
    session.flush()
    repository.hold_chain(session)
    key = chain.chain_key(session.info[SIGNING_KEY]() if SIGNING_KEY in session.info else b"")
    position, previous = repository.last_link(session) or (0, chain.START)
    for entry in entries:
        position += 1
        entry.position, entry.details_salt = position, secrets.token_hex(16)
        entry.details_digest = chain.details_digest(key, entry.details_salt, entry.details)
        previous = chain.entry_hash(key, previous, linked(entry), entry.details_digest)
        entry.chain_hash = previous
    session.flush()
    if address := session.info.get(SYSLOG):
        lines = [written(entry) for entry in entries]
        event.listen(session, "after_commit", lambda _session: forward(address, lines), once=True)


def linked(entry: AuditEntry) -> chain.Entry:
    """What the chain holds of a row."""
    return chain.Entry(
        entry.position or 0, entry.at, entry.actor, entry.action, entry.target_kind, entry.target
    )


def written(entry: AuditEntry) -> dict[str, object]:
    """An entry as a line of an export, without the salt of its details."""
    return {
        "position": entry.position,
        "at": entry.at.isoformat(),
        "actor": entry.actor,
        "action": entry.action,
        "target_kind": entry.target_kind,
        "target": entry.target,
        "details": entry.details,
        "details_digest": entry.details_digest,
        "hash": entry.chain_hash,
    }
