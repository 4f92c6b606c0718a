"""Queries of the audit log and its chain."""

from collections.abc import Iterator

from sqlalchemy import case, func, not_, select, text, true
from sqlalchemy.orm import Session

from server.models import AuditEntry

_LOCK = 7_202_612  # any number, the same for every worker
BATCH = 1000


def hold_chain(session: Session) -> None:
    """Let nobody else add to the chain until this transaction ends; SQLite lets one in anyway."""
    if session.get_bind().dialect.name == "postgresql":
        session.execute(text("SELECT pg_advisory_xact_lock(:number)"), {"number": _LOCK})


def last_link(session: Session) -> tuple[int, str] | None:
    """Position and hash of the chain's last entry."""
    query = select(AuditEntry.position, AuditEntry.chain_hash).where(AuditEntry.position.is_not(None))
    row = session.execute(query.order_by(AuditEntry.position.desc()).limit(1)).first()
    return None if row is None else (row[0] or 0, row[1] or "")


def chained(session: Session, after: int = 0) -> Iterator[AuditEntry]:
    """The entries of the chain behind a position, in its order and in constant memory."""
    query = select(AuditEntry).where(AuditEntry.position > after).order_by(AuditEntry.position)
    for batch in session.scalars(query.execution_options(yield_per=BATCH)).partitions():
        yield from batch
        session.expunge_all()


def chain_pages(session: Session) -> Iterator[list[AuditEntry]]:
    """The chain in its order, some entries at a time; what is changed of them is written before the next."""
    last = 0
    query = select(AuditEntry).order_by(AuditEntry.position).limit(BATCH)
    while page := list(session.scalars(query.where(AuditEntry.position > last))):
        last = page[-1].position or 0
        yield page
        session.flush()
        session.expunge_all()


def first_id(session: Session) -> int | None:
    """The number of the chain's first row."""
    return session.scalar(select(func.min(AuditEntry.id)).where(AuditEntry.position.is_not(None)))


def unchained(session: Session, first: int | None) -> tuple[int, int | None]:
    """Of the rows in no chain, how many are older than its first row, and the number of one that is not."""
    older = true() if first is None else AuditEntry.id < first
    count, stray = func.count(case((older, 1))), func.min(case((not_(older), AuditEntry.id)))
    row = session.execute(select(count, stray).where(AuditEntry.position.is_(None))).one()
    return row[0], row[1]


def erased_runs(session: Session) -> set[str]:
    """Public ids of the runs that the log says were erased."""
    query = select(AuditEntry.target).where(
        AuditEntry.action == "run erased", AuditEntry.position.is_not(None)
    )
    return set(session.scalars(query))


def entries_on_run(session: Session, public_id: str) -> list[AuditEntry]:
    """What the log says of a run."""
    query = select(AuditEntry).where(AuditEntry.target_kind == "run", AuditEntry.target == public_id)
    return list(session.scalars(query))


def latest(session: Session, before: int | None, limit: int) -> list[AuditEntry]:
    """The latest entries with a number below `before`, newest first."""
    query = select(AuditEntry).order_by(AuditEntry.id.desc()).limit(limit)
    return list(session.scalars(query if before is None else query.where(AuditEntry.id < before)))
