"""The audit log: one row for every change and every look at single persons, chained by hashes."""

import hashlib
import hmac
import json
import logging
import queue
import secrets
import socket
import ssl
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from logging.handlers import SysLogHandler
from pathlib import Path
from typing import Any, Literal, NamedTuple

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from sqlalchemy import event
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from experiments.errors import InputError
from server.accounts import repository
from server.accounts.identity import OPERATOR, Identity, Operator
from server.core.db import SIGNING_KEY, SYSLOG, Database
from server.core.errors import ApiError
from server.core.limits import BoundedRecords
from server.core.logs import describe_error
from server.core.settings import syslog_address
from server.core.values import now
from server.models import AuditEntry

# The chain of the audit log: each entry's hash holds the one before it, keyed by the server's secret.
#
# With k a key derived from the secret key, s an entry's salt and d its details as JSON,
#
#     D = HMAC-SHA256(k, "details" | s | d)                                               (1)
#     H_n = HMAC-SHA256(k, "entry" | H_(n-1) | n | time | actor | action | kind | target | D)   (2)
#
# Anyone who can write to the database but does not have the key cannot change, remove or put in an entry
# without breaking (2) at it. What the database alone cannot show is that the last entries were cut off, or
# the whole chain taken away from rows that stay: keep the newest hash elsewhere (export, syslog) and verify
# with it. Details can be erased with their salt, as data protection asks; D stays, and reveals nothing
# without s.

START = "0" * 64
"""What stands for the hash before the first entry."""


class Entry(NamedTuple):
    """What the chain holds of an entry of the audit log."""

    position: int
    at: datetime
    actor: str
    action: str
    target_kind: str
    target: str


def chain_key(secret: bytes) -> bytes:
    """The key of the chain: of this purpose alone."""
    return hmac.new(secret, b"audit chain", hashlib.sha256).digest()


def details_digest(key: bytes, salt: str, details: dict[str, Any]) -> str:
    """Equation (1), 64 hexadecimal digits.

    >>> a = details_digest(b"k", "s", {"a": 1, "b": [2]})
    >>> a == details_digest(b"k", "s", {"b": [2], "a": 1}) != details_digest(b"k", "t", {"a": 1, "b": [2]})
    True
    """
    return _keyed_hash(key, ["details", salt, details])


# Decision 0686: The audit log is a keyed hash chain.
def entry_hash(key: bytes, previous: str, entry: Entry, digest: str) -> str:
    """Equation (2), 64 hexadecimal digits; `previous` is the hash of the entry before, or `START`."""
    at = entry.at.astimezone(UTC).isoformat(timespec="microseconds")
    return _keyed_hash(key, ["entry", previous, entry.position, at, *entry[2:], digest])


def _keyed_hash(key: bytes, parts: list[Any]) -> str:
    text = json.dumps(parts, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return hmac.new(key, text.encode("ascii"), hashlib.sha256).hexdigest()


# Entries of the audit log to syslog, where `PALPEBRA_AUDIT_SYSLOG` names one.

log = logging.getLogger("palpebra")
CONNECT_S = 5.0
WAITING_MAX = 1000
"""Entries that may wait for a syslog that is slow."""


def forward(address: str, entries: list[dict[str, object]]) -> None:
    """Send entries, details left out, in a separate thread: a syslog that is away delays no request.

    Entries that cannot be sent, or wait while `WAITING_MAX` others do, are dropped with a line of log: the
    log in the database has them.
    """
    waiting = _queue(address)
    for entry in entries:
        kept = {name: value for name, value in entry.items() if name != "details"}
        try:
            waiting.put_nowait(json.dumps(kept))
        except queue.Full:
            log.warning(
                "the audit log could not be sent to syslog: %d entries are already waiting", WAITING_MAX
            )
            return


@lru_cache(maxsize=4)
def _queue(address: str) -> "queue.Queue[str]":
    waiting: queue.Queue[str] = queue.Queue(WAITING_MAX)
    threading.Thread(target=_send, args=(address, waiting), name="audit-syslog", daemon=True).start()
    return waiting


def _send(address: str, waiting: "queue.Queue[str]") -> None:
    handler: SysLogHandler | None = None
    while True:
        line = waiting.get()
        try:
            handler = handler or _handler(address)
            handler.emit(logging.makeLogRecord({"msg": line, "levelno": logging.INFO}))
        except (OSError, ValueError) as error:  # ValueError: what is no name for DNS, or no socket
            log.warning("the audit log could not be sent to syslog: %s", error)


class _Handler(SysLogHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - as logging calls it
        log.warning("the audit log could not be sent to syslog")


class _Stream(_Handler):
    """Syslog over TCP (RFC 6587), or TLS with the certificate checked (RFC 5425): lengths before messages."""

    def __init__(self, host: str, port: int, *, tls: bool) -> None:
        self._host, self._port, self._tls = host, port, tls
        self._connection: socket.socket | None = None
        super().__init__((host, port), facility=SysLogHandler.LOG_AUTH, socktype=socket.SOCK_STREAM)

    def createSocket(self) -> None:  # noqa: N802 - as logging calls it
        """Connect; a syslog that is away is asked again with the next entry."""
        connection = socket.create_connection((self._host, self._port), timeout=CONNECT_S)
        if self._tls:
            context = ssl.create_default_context()
            connection = context.wrap_socket(connection, server_hostname=self._host.partition("%")[0])
        self._connection = connection

    def emit(self, record: logging.LogRecord) -> None:
        """Send one message, over a new connection where the last was ended; OSError where that fails too."""
        line = f"<{self.encodePriority(self.facility, 'info')}>{self.format(record)}".encode()
        if self._connection is not None and not _hung_up(self._connection):
            try:
                self._send(line)
            except OSError:
                log.info("the connection to syslog was lost; the message is sent again over a new connection")
            else:
                return
        self._hang_up()
        self.createSocket()
        try:
            self._send(line)
        except OSError:
            self._hang_up()
            raise

    def _send(self, line: bytes) -> None:
        if self._connection is not None:
            self._connection.sendall(b"%d " % len(line) + line)

    def _hang_up(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None


def _hung_up(connection: socket.socket) -> bool:
    """Whether the other side has hung up, as one that restarts does: what is sent then is lost, unsaid."""
    connection.settimeout(0)
    try:
        return connection.recv(1) == b""
    except (BlockingIOError, ssl.SSLWantReadError):
        return False
    except OSError:
        return True
    finally:
        connection.settimeout(CONNECT_S)


def _handler(address: str) -> SysLogHandler:
    listening = syslog_address(address)
    handler: SysLogHandler
    if listening.transport in ("tcp", "tls"):
        handler = _Stream(listening.host, listening.port, tls=listening.transport == "tls")
    elif listening.transport == "udp":
        handler = _Handler((listening.host, listening.port), facility=SysLogHandler.LOG_AUTH)
    elif Path(listening.host).exists():
        handler = _Handler(listening.host, facility=SysLogHandler.LOG_AUTH)
    else:
        raise InputError(
            f"PALPEBRA_AUDIT_SYSLOG: expected a socket, found none at {listening.host}; start syslog "
            "or correct the setting"
        )
    handler.setFormatter(logging.Formatter("palpebra-audit: %(message)s"))
    return handler


# Entries join the chain as the last thing before their transaction is committed, one at a time.

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
    key = chain_key(session.info[SIGNING_KEY]() if SIGNING_KEY in session.info else b"")
    position, previous = repository.last_link(session) or (0, START)
    for entry in entries:
        position += 1
        entry.position, entry.details_salt = position, secrets.token_hex(16)
        entry.details_digest = details_digest(key, entry.details_salt, entry.details)
        previous = entry_hash(key, previous, chain_entry(entry), entry.details_digest)
        entry.chain_hash = previous
    session.flush()
    if address := session.info.get(SYSLOG):
        lines = [export_line(entry) for entry in entries]
        event.listen(session, "after_commit", lambda _session: forward(address, lines), once=True)


def chain_entry(entry: AuditEntry) -> Entry:
    """What the chain holds of a row."""
    return Entry(entry.position or 0, entry.at, entry.actor, entry.action, entry.target_kind, entry.target)


def export_line(entry: AuditEntry) -> dict[str, object]:
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


# The audit log: one row for every change an experimenter makes, and for every look at single persons.

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
    """Add an entry in the caller's transaction, so that a change and its entry succeed or fail together.

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
    return repository.latest_entries(session, before, limit)


# Refusals that are written down: rights that somebody has not, others' studies, unknown tokens.

ADMIN = "/api/admin/"


async def note_refusal(
    request: Request,
    refusal: ApiError,
    database: Database,
    known: BoundedRecords,
    strangers: BoundedRecords,
) -> None:
    """Record a refusal of the admin API, a limited number per minute; the rest are counted.

    Where it cannot be written the refusal is answered all the same, and the log has a line.

    Parameters
    ----------
    known, strangers : BoundedRecords
        How many a minute: of accounts, and of nobody.
    """
    if request.url.path.startswith(ADMIN):
        actor = getattr(request.state, "identity", None) or NOBODY
        records = strangers if actor == NOBODY else known
        try:
            await run_in_threadpool(_write_refusal, request, refusal, actor, database, records)
        except (SQLAlchemyError, OSError, ValueError) as error:
            log.error("a refusal could not be written to the audit log: %s", describe_error(error))


def _write_refusal(
    request: Request,
    refusal: ApiError,
    actor: Identity | Literal["nobody"],
    database: Database,
    records: BoundedRecords,
) -> None:
    route = f"{request.method} {getattr(request.scope.get('route'), 'path', 'unmatched')}"
    name = NOBODY if actor == NOBODY else actor.name
    unwritten = records.written(f"{name} {route} {refusal.code}")
    if unwritten is None:
        return
    details: dict[str, Any] = {"code": refusal.code, "status": refusal.status}
    details |= {"not_written_before": unwritten} if unwritten else {}
    # No column of PostgreSQL holds a NUL.
    study = str(request.path_params.get("study", "")).replace("\0", "\ufffd")
    with database.write() as session:
        if study:
            record(session, actor, "refused", "study", study, **details, route=route)
        else:
            record(session, actor, "refused", "route", route, **details)


# Prove that the audit log is whole, and give its chain another key.

# `server audit verify`: go along the chain, and name the first entry that does not fit.


@dataclass(frozen=True)
class Verdict:
    """What going along the chain gave.

    Attributes
    ----------
    position, hash : int, str
        Of the last entry that fits.
    erased : int
        Entries whose details were erased with a person.
    before : int
        Rows from before there was a chain.
    broken : str or None
        What does not fit first; None where all does.
    """

    position: int
    hash: str
    erased: int
    before: int
    broken: str | None


def verify(
    session: Session, secret: bytes, kept: tuple[int, str] | None = None, before: bytes | None = None
) -> Verdict:
    """Check every entry.

    Parameters
    ----------
    secret : bytes
        The server's key.
    kept : tuple of int and str, optional
        A position and its hash, noted elsewhere, that the chain must hold.
    before : bytes, optional
        An earlier key, under which entries at the beginning may be.
    """
    keys = _Keys(secret, before)
    erased_runs = repository.erased_runs(session)
    position, previous, erased, seen = 0, START, 0, kept is None
    broken: str | None = None
    for entry in repository.chained_entries(session):
        broken = keys.problem(position, previous, entry, erased_runs)
        if broken is not None:
            break
        position, previous = entry.position or 0, entry.chain_hash or ""
        erased += entry.details_salt is None
        seen = seen or kept == (position, previous)
    if broken is None and not seen and kept is not None:
        broken = f"entry {kept[0]}, whose hash was saved, is not in the chain: it was changed or removed"
    first = repository.first_id(session)
    older, stray = repository.unchained_entries(session, first)
    if broken is None and stray is not None:
        broken = f"row {stray} is between the rows of the chain but not part of it: it was inserted"
    return Verdict(position, previous, erased, older, broken)


class _Keys:
    """The earlier key, while entries fit it, and then for good the present key."""

    def __init__(self, secret: bytes, before: bytes | None) -> None:
        self._now = chain_key(secret)
        self._old = None if before is None else chain_key(before)

    def problem(self, last: int, previous: str, entry: AuditEntry, erased_runs: set[str]) -> str | None:
        """What is wrong with an entry; None where it fits."""
        by_now = _problem(self._now, last, previous, entry, erased_runs)
        if self._old is None:
            return by_now
        by_old = _problem(self._old, last, previous, entry, erased_runs)
        if by_old is not None and by_now is None:
            self._old = None
            return None
        return by_old


def _problem(key: bytes, last: int, previous: str, entry: AuditEntry, erased_runs: set[str]) -> str | None:
    named = f"entry {entry.position} (row {entry.id}, {entry.at:%Y-%m-%d %H:%M:%S}, {entry.action})"
    if entry.position != last + 1:
        return f"entry {last + 1} is missing; the next existing entry is {named}"
    digest = entry.details_digest or ""
    if entry.chain_hash != entry_hash(key, previous, chain_entry(entry), digest):
        return f"{named} does not match the chain: the entry or the key of this server was changed"
    if entry.details_salt is not None:
        fits = digest == details_digest(key, entry.details_salt, entry.details)
        return None if fits else f"{named}: its details were changed"
    if entry.target_kind != "run" or entry.target not in erased_runs:
        return f"{named}: its details were removed, and no erasure of a person explains it"
    return None


# The chain of the audit log under another key of the server: every entry's hashes are recomputed.


def reseal(session: Session, secret: bytes) -> tuple[int, str]:
    """Recompute the hashes of a chain that was verified; its contents stay.

    What is left of details that were erased is taken as it is: without their salt nobody can recompute it.

    Returns
    -------
    tuple of int and str
        The chain's new head.
    """
    key, position, previous = chain_key(secret), 0, START
    for page in repository.chain_pages(session):
        for entry in page:
            if entry.details_salt is not None:
                entry.details_digest = details_digest(key, entry.details_salt, entry.details)
            previous = entry_hash(key, previous, chain_entry(entry), entry.details_digest or "")
            entry.chain_hash, position = previous, entry.position or 0
    return position, previous


def entries_under_key(session: Session, secret: bytes) -> Iterator[AuditEntry]:
    """The entries whose hash fits this key, whatever became of others, in the chain's order."""
    key, previous = chain_key(secret), START
    for entry in repository.chained_entries(session):
        digest, stored = entry.details_digest or "", entry.chain_hash or ""
        if stored == entry_hash(key, previous, chain_entry(entry), digest):
            yield entry
        previous = stored
