"""Queries of accounts, their sessions, tokens and invitations."""

from datetime import datetime
from typing import Any, cast

from sqlalchemy import CursorResult, delete, func, select, update
from sqlalchemy.orm import Session

from server.clock import now
from server.models import (
    Account,
    AccountLogin,
    AdminSession,
    ApiToken,
    Invitation,
    LoginAttempt,
    MailedLink,
    Workspace,
)


def any_accounts(session: Session) -> bool:
    """False until the first account has been made."""
    return bool(session.scalar(select(func.count()).select_from(Account)))


def accounts(session: Session) -> list[Account]:
    """Every account, the oldest first."""
    return list(session.scalars(select(Account).order_by(Account.id)))


def with_second_factor(session: Session) -> list[Account]:
    """Accounts with a second factor, by their numbers; held."""
    query = select(Account).where(Account.totp_confirmed_at.is_not(None)).order_by(Account.id)
    return list(session.scalars(query.with_for_update()))


def account(session: Session, account_id: int, *, fresh: bool = False, lock: bool = False) -> Account | None:
    """An account by its number.

    Parameters
    ----------
    fresh : bool, optional
        Read it again where the session has it.
    lock : bool, optional
        Read it again, and hold it until the commit.
    """
    return session.get(Account, account_id, populate_existing=fresh or lock, with_for_update=lock or None)


def account_named(session: Session, name: str, *, lock: bool = False) -> Account | None:
    """An account by its name in any spelling of capitals, its own first; `lock` holds it until the commit."""
    query = select(Account).where(func.lower(Account.name) == name.lower())
    query = query.order_by(Account.name != name, Account.id).limit(1)
    return session.scalar(query.with_for_update() if lock else query)


def hold(session: Session, account_id: int) -> None:
    """Hold an account until the commit: nothing is begun in its name while a new password ends everything."""
    session.execute(select(Account.id).where(Account.id == account_id).with_for_update())


def hold_owners(session: Session) -> None:
    """Hold every owner's account until the commit: two who demote each other at once would leave none."""
    session.scalars(select(Account.id).where(Account.role == "owner").with_for_update()).all()


def owners_left(session: Session) -> bool:
    """True while an owner is there who is not disabled."""
    query = select(func.count()).where(Account.role == "owner", Account.disabled_at.is_(None))
    return bool(session.scalar(query))


def session_by_token(session: Session, token_hash: str) -> AdminSession | None:
    """A signed-in browser by the hash of its cookie."""
    return session.scalar(select(AdminSession).where(AdminSession.token_hash == token_hash))


def session_of(session: Session, account_id: int, session_id: int | None) -> AdminSession | None:
    """One of an account's own sessions."""
    row = session.get(AdminSession, session_id) if session_id is not None else None
    return row if row is not None and row.account_id == account_id else None


def sessions(session: Session, account_id: int) -> list[AdminSession]:
    """All sessions of an account, ended ones too."""
    return list(session.scalars(select(AdminSession).where(AdminSession.account_id == account_id)))


def open_sessions(session: Session, account_id: int, idle_since: datetime) -> list[AdminSession]:
    """Sessions of an account that are neither revoked nor expired and were used since, the latest first."""
    query = select(AdminSession).where(
        AdminSession.account_id == account_id,
        AdminSession.revoked_at.is_(None),
        AdminSession.expires_at > now(),
        AdminSession.last_seen_at > idle_since,
    )
    return list(session.scalars(query.order_by(AdminSession.last_seen_at.desc())))


def end_sign_ins_that_ask_for_a_code(session: Session, account_id: int) -> None:
    """End the sign-ins of an account that its provider confirmed and that wait for its second factor."""
    waiting = delete(LoginAttempt).where(LoginAttempt.account_id == account_id)
    session.execute(waiting.where(LoginAttempt.purpose == "code"))


def token_by_hash(session: Session, token_hash: str) -> ApiToken | None:
    """An API token by the hash of its secret."""
    return session.scalar(select(ApiToken).where(ApiToken.token_hash == token_hash))


def token_of(session: Session, account_id: int, token_id: int) -> ApiToken | None:
    """One of an account's own API tokens."""
    row = session.get(ApiToken, token_id)
    return row if row is not None and row.account_id == account_id else None


def tokens(session: Session, account_id: int) -> list[ApiToken]:
    """All API tokens of an account, revoked ones too."""
    query = select(ApiToken).where(ApiToken.account_id == account_id)
    return list(session.scalars(query.order_by(ApiToken.id)))


def forget_under_way(session: Session, account_id: int) -> None:
    """Remove what was begun in an account's name: links sent by mail, and sign-ins at a provider."""
    session.execute(delete(MailedLink).where(MailedLink.account_id == account_id))
    session.execute(delete(LoginAttempt).where(LoginAttempt.account_id == account_id))


def logins(session: Session, account_id: int) -> list[AccountLogin]:
    """The logins of an account with providers, the oldest first."""
    query = select(AccountLogin).where(AccountLogin.account_id == account_id)
    return list(session.scalars(query.order_by(AccountLogin.id)))


def invitation(session: Session, invitation_id: int) -> Invitation | None:
    """An invitation by its number."""
    return session.get(Invitation, invitation_id)


def invitation_by_token(session: Session, token_hash: str) -> Invitation | None:
    """An invitation by the hash of its link's token."""
    return session.scalar(select(Invitation).where(Invitation.token_hash == token_hash))


def open_invitations(session: Session) -> list[Invitation]:
    """Invitations that have neither been used nor expired."""
    query = select(Invitation).where(Invitation.used_at.is_(None), Invitation.expires_at > now())
    return list(session.scalars(query.order_by(Invitation.id)))


def use_invitation(session: Session, invitation_id: int) -> bool:
    """Mark an invitation as used; False where it was used or has expired.

    One statement decides, so that of many who come at once one is let in, whatever the database.
    """
    used = (
        update(Invitation)
        .where(Invitation.id == invitation_id, Invitation.used_at.is_(None), Invitation.expires_at > now())
        .values(used_at=now())
    )
    return cast(CursorResult[Any], session.execute(used)).rowcount == 1


def workspace_of(session: Session, invited: Invitation) -> Workspace | None:
    """The workspace an invitation is to; None where it names none."""
    return session.get(Workspace, invited.workspace_id) if invited.workspace_id else None
