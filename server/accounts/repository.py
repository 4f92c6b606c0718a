"""Queries of accounts, sessions, tokens, invitations, the audit log, logins by providers and mailed links."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, case, delete, func, not_, or_, select, text, true, update
from sqlalchemy.orm import Session

from server.core.values import now
from server.models import (
    Account,
    AccountLogin,
    AdminSession,
    ApiToken,
    AuditEntry,
    Invitation,
    LetterPurpose,
    LoginAttempt,
    MailedLink,
    Purpose,
    Workspace,
)

# Queries of accounts, their sessions, tokens and invitations.


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
    """An account by name in any spelling of capitals, its own first; `lock` holds it until the commit."""
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


# Queries of the audit log and its chain.

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


def chained_entries(session: Session, after: int = 0) -> Iterator[AuditEntry]:
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


def unchained_entries(session: Session, first: int | None) -> tuple[int, int | None]:
    """How many rows outside the chain are older than its first row, and the id of the first that is not."""
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


def latest_entries(session: Session, before: int | None, limit: int) -> list[AuditEntry]:
    """The latest entries with a number below `before`, newest first."""
    query = select(AuditEntry).order_by(AuditEntry.id.desc()).limit(limit)
    return list(session.scalars(query if before is None else query.where(AuditEntry.id < before)))


# Queries of logins by providers, and of sign-ins under way.


def find_login(session: Session, issuer: str, subject: str) -> AccountLogin | None:
    """The login of a subject; None where it is nobody's."""
    query = select(AccountLogin).where(AccountLogin.issuer == issuer, AccountLogin.subject == subject)
    return session.scalar(query)


def logins_of(session: Session, account_id: int) -> list[AccountLogin]:
    """The logins of an account, the oldest first."""
    query = select(AccountLogin).where(AccountLogin.account_id == account_id)
    return list(session.scalars(query.order_by(AccountLogin.id)))


def find_attempt(
    session: Session, state_hash: str, browser_hash: str, *purposes: Purpose
) -> LoginAttempt | None:
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


# Queries of links sent by mail.

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


def find_mailed_link(session: Session, token_hash: str, purpose: LetterPurpose) -> MailedLink | None:
    """The link of a token; None where it is unknown, used or too old."""
    query = select(MailedLink).where(
        MailedLink.token_hash == token_hash, MailedLink.purpose == purpose, MailedLink.expires_at > now()
    )
    return session.scalar(query)


def use_link(session: Session, link_id: int) -> bool:
    """Remove a link; False where somebody else did at this moment, so that it works once."""
    used = delete(MailedLink).where(MailedLink.id == link_id)
    return cast(CursorResult[Any], session.execute(used)).rowcount == 1


def forget_links(session: Session, account_id: int, purpose: LetterPurpose) -> None:
    """Remove the other links of an account for this purpose."""
    session.execute(
        delete(MailedLink).where(MailedLink.account_id == account_id, MailedLink.purpose == purpose)
    )


def forget_old(session: Session) -> None:
    """Remove the links that nobody used within a day."""
    session.execute(delete(MailedLink).where(MailedLink.created_at <= now() - KEPT))
