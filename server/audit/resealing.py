"""The chain of the audit log under another key of the server: every entry's hashes made anew."""

from collections.abc import Iterator

from sqlalchemy.orm import Session

from server.audit import chain, repository
from server.audit.sealing import linked
from server.models import AuditEntry


def reseal(session: Session, secret: bytes) -> tuple[int, str]:
    """Make the hashes of a chain that was verified anew; whatever is in it stays.

    What is left of details that were erased is taken as it is: without their salt nobody can make it anew.

    Returns
    -------
    tuple of int and str
        The chain's new head.
    """
    key, position, previous = chain.chain_key(secret), 0, chain.START
    for page in repository.chain_pages(session):
        for entry in page:
            if entry.details_salt is not None:
                entry.details_digest = chain.details_digest(key, entry.details_salt, entry.details)
            previous = chain.entry_hash(key, previous, linked(entry), entry.details_digest or "")
            entry.chain_hash, position = previous, entry.position or 0
    return position, previous


def under(session: Session, secret: bytes) -> Iterator[AuditEntry]:
    """The entries whose hash fits this key, whatever became of others, in the chain's order."""
    key, previous = chain.chain_key(secret), chain.START
    for entry in repository.chained(session):
        digest, stored = entry.details_digest or "", entry.chain_hash or ""
        if stored == chain.entry_hash(key, previous, linked(entry), digest):
            yield entry
        previous = stored
