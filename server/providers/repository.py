"""Queries of logins by providers, and of sign-ins under way."""

from typing import Any, cast

from sqlalchemy import CursorResult, delete, select, update
from sqlalchemy.orm import Session

from server.clock import now
from server.models import AccountLogin, AdminSession, LoginAttempt, Purpose


def login(session: Session, issuer: str, subject: str) -> AccountLogin | None:
    """The login of a subject; None where it is nobody's."""
    query = select(AccountLogin).where(AccountLogin.issuer == issuer, AccountLogin.subject == subject)
    return session.scalar(query)


def logins_of(session: Session, account_id: int) -> list[AccountLogin]:
    """The logins of an account, the oldest first."""
    query = select(AccountLogin).where(AccountLogin.account_id == account_id)
    return list(session.scalars(query.order_by(AccountLogin.id)))


def attempt(session: Session, state_hash: str, browser_hash: str, *purposes: Purpose) -> LoginAttempt | None:
    """A sign-in under way, for the browser that began it; None where there is none, or no longer."""
    query = select(LoginAttempt).where(
        LoginAttempt.state_hash == state_hash,
        LoginAttempt.browser_hash == browser_hash,
        LoginAttempt.purpose.in_(purposes),
        LoginAttempt.expires_at > now(),
    )
    return session.scalar(query)


def end_attempt(session: Session, attempt_id: int) -> bool:
    """Remove a sign-in under way; False where somebody else did at this moment, so that it counts once."""
    ended = delete(LoginAttempt).where(LoginAttempt.id == attempt_id)
    return cast(CursorResult[Any], session.execute(ended)).rowcount == 1


def forget_old_attempts(session: Session) -> None:
    """Remove the sign-ins that nobody finished in time."""
    session.execute(delete(LoginAttempt).where(LoginAttempt.expires_at <= now()))


def end_sessions(session: Session, account_id: int, provider: str, spared: int | None = None) -> int:
    """End an account's open sessions that a provider began, but for `spared`, and waiting sign-ins."""
    waiting = delete(LoginAttempt).where(LoginAttempt.account_id == account_id)
    session.execute(waiting.where(LoginAttempt.provider == provider, LoginAttempt.purpose == "code"))
    ended = update(AdminSession).where(
        AdminSession.account_id == account_id,
        AdminSession.provider == provider,
        AdminSession.revoked_at.is_(None),
        AdminSession.id != (spared or 0),
    )
    return cast(CursorResult[Any], session.execute(ended.values(revoked_at=now()))).rowcount
