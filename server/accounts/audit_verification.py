"""Prove that the audit log is whole, and give its chain another key."""

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy.orm import Session

from server.accounts import audit, repository
from server.accounts.audit import chain_entry
from server.models import AuditEntry

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
        A key of before, under which entries at the beginning may be.
    """
    keys = _Keys(secret, before)
    erased_runs = repository.erased_runs(session)
    position, previous, erased, seen = 0, audit.START, 0, kept is None
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
    """The key of before, while entries fit it, and then for good the key of now."""

    def __init__(self, secret: bytes, before: bytes | None) -> None:
        self._now = audit.chain_key(secret)
        self._old = None if before is None else audit.chain_key(before)

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
    if entry.chain_hash != audit.entry_hash(key, previous, chain_entry(entry), digest):
        return f"{named} does not match the chain: the entry or the key of this server was changed"
    if entry.details_salt is not None:
        fits = digest == audit.details_digest(key, entry.details_salt, entry.details)
        return None if fits else f"{named}: its details were changed"
    if entry.target_kind != "run" or entry.target not in erased_runs:
        return f"{named}: its details were removed, and no erasure of a person explains it"
    return None


# The chain of the audit log under another key of the server: every entry's hashes made anew.


def reseal(session: Session, secret: bytes) -> tuple[int, str]:
    """Make the hashes of a chain that was verified anew; whatever is in it stays.

    What is left of details that were erased is taken as it is: without their salt nobody can make it anew.

    Returns
    -------
    tuple of int and str
        The chain's new head.
    """
    key, position, previous = audit.chain_key(secret), 0, audit.START
    for page in repository.chain_pages(session):
        for entry in page:
            if entry.details_salt is not None:
                entry.details_digest = audit.details_digest(key, entry.details_salt, entry.details)
            previous = audit.entry_hash(key, previous, chain_entry(entry), entry.details_digest or "")
            entry.chain_hash, position = previous, entry.position or 0
    return position, previous


def entries_under_key(session: Session, secret: bytes) -> Iterator[AuditEntry]:
    """The entries whose hash fits this key, whatever became of others, in the chain's order."""
    key, previous = audit.chain_key(secret), audit.START
    for entry in repository.chained_entries(session):
        digest, stored = entry.details_digest or "", entry.chain_hash or ""
        if stored == audit.entry_hash(key, previous, chain_entry(entry), digest):
            yield entry
        previous = stored
