"""Queries of links sent by mail."""

from datetime import timedelta
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, delete, func, or_, select
from sqlalchemy.orm import Session

from server.clock import now
from server.models import Account, LetterPurpose, MailedLink

KEPT = timedelta(days=1)
"""How long a link is kept that nobody used: it works for half an hour, and counts for a day."""


def accounts_to_write_to(session: Session, name: str) -> list[Account]:
    """Open accounts with a confirmed address that are called `name` or have it as their address."""
    told = name.lower()
    query = select(Account).where(
        or_(func.lower(Account.name) == told, func.lower(Account.email) == told),
        Account.email.is_not(None),
        Account.disabled_at.is_(None),
    )
    return list(session.scalars(query.order_by(Account.id).with_for_update()))


def open_links(session: Session, account_id: int, purpose: LetterPurpose) -> int:
    """How many links of an account still work for this purpose."""
    return _count(session, account_id, purpose, MailedLink.expires_at > now())


def links_of_a_day(session: Session, account_id: int, purpose: LetterPurpose) -> int:
    """How many links of an account for this purpose went out in the last 24 hours and were not used."""
    return _count(session, account_id, purpose, MailedLink.created_at > now() - KEPT)


def _count(session: Session, account_id: int, purpose: LetterPurpose, *which: ColumnElement[bool]) -> int:
    query = select(func.count()).where(
        MailedLink.account_id == account_id, MailedLink.purpose == purpose, *which
    )
    return session.scalar(query) or 0


def link(session: Session, token_hash: str, purpose: LetterPurpose) -> MailedLink | None:
    """The link of a token; None where it is unknown, used or too old."""
    query = select(MailedLink).where(
        MailedLink.token_hash == token_hash, MailedLink.purpose == purpose, MailedLink.expires_at > now()
    )
    return session.scalar(query)


def use(session: Session, link_id: int) -> bool:
    """Remove a link; False where somebody else did at this moment, so that it works once."""
    used = delete(MailedLink).where(MailedLink.id == link_id)
    return cast(CursorResult[Any], session.execute(used)).rowcount == 1


def forget(session: Session, account_id: int, purpose: LetterPurpose) -> None:
    """Remove the other links of an account for this purpose."""
    session.execute(
        delete(MailedLink).where(MailedLink.account_id == account_id, MailedLink.purpose == purpose)
    )


def forget_old(session: Session) -> None:
    """Remove the links that nobody used within a day."""
    session.execute(delete(MailedLink).where(MailedLink.created_at <= now() - KEPT))
