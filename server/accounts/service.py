"""Signing in, invitations, second factor, tokens: the rules behind the account endpoints."""

from datetime import datetime, timedelta

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.accounts import second_factor
from server.accounts.audit import record
from server.accounts.identity import Identity, Role, account_of
from server.accounts.passwords import hash_password, password_fits
from server.clock import now
from server.context import Services
from server.db import Database
from server.errors import ApiError, Conflict, NotFound
from server.models import Account, AdminSession, ApiToken, Invitation
from server.tokens import hash_token, new_token

WRONG_BEFORE_LOCK = 10
LOCK_SHORTEST, LOCK_LONGEST = timedelta(minutes=1), timedelta(minutes=15)
INVITATION_DAYS = 7


class WrongCredentials(ApiError):
    """Name, password or code do not fit."""

    status = 401
    code = "wrong_credentials"


class SecondFactorRequired(ApiError):
    """The password fits; a code is needed too."""

    status = 401
    code = "second_factor_required"


class AccountLocked(ApiError):
    """Too many wrong passwords; wait."""

    status = 429
    code = "account_locked"


def identity_of(account: Account, session_id: int | None = None) -> Identity:
    """The identity of an account that has just been recognised."""
    return Identity(account.id, account.name, account.role, session_id=session_id)


def accounts_exist(session: Session) -> bool:
    """False until the first account has been made."""
    return bool(session.scalar(select(func.count()).select_from(Account)))


def sign_in(services: Services, name: str, password: str, code: str | None, user_agent: str) -> str:
    """Check the credentials and return the token of a new session (the cookie's value)."""
    with services.database.read() as session:
        account = _by_name(session, name)
        stored = account.password_hash if account else None
        locked = account.locked_until if account else None
    if locked is not None and locked > now():
        raise _locked(locked)
    # argon2 takes its time: not inside a transaction.
    fits = password_fits(password, stored)
    with services.database.write() as session:
        account = _by_name(session, name)
        if account is None or account.disabled_at is not None or not fits:
            failure: ApiError | None = WrongCredentials("Name or password are wrong.")
        else:
            failure = _second_factor_failure(services, account, code)
        if failure is None and account is not None:
            account.failed_logins, account.locked_until = 0, None
            token = _open_session(services, session, account, user_agent)
            record(session, identity_of(account), "signed in", "account", account.name)
            return token
        if account is not None and not isinstance(failure, SecondFactorRequired):
            _count_failure(session, account)
    raise failure or WrongCredentials("Name or password are wrong.")


def _by_name(session: Session, name: str) -> Account | None:
    return session.scalar(select(Account).where(func.lower(Account.name) == name.lower()))


def _locked(until: datetime) -> AccountLocked:
    wait = max(1, round((until - now()).total_seconds()))
    return AccountLocked(
        f"Too many wrong passwords; please try again in {wait} s.", headers={"retry-after": str(wait)}
    )


def _second_factor_failure(services: Services, account: Account, code: str | None) -> ApiError | None:
    if account.totp_secret is None or account.totp_confirmed_at is None:
        return None
    if not code:
        return SecondFactorRequired("Please enter the code of your authenticator app, or a recovery code.")
    secret = second_factor.secret_of(services.settings.key, account.totp_secret)
    step = second_factor.accepted_step(secret, code, account.totp_last_step)
    if step is not None:
        account.totp_last_step = step
        return None
    hashed = second_factor.hash_recovery_code(code)
    if hashed in account.recovery_code_hashes:
        account.recovery_code_hashes = [kept for kept in account.recovery_code_hashes if kept != hashed]
        return None
    return WrongCredentials("That code is wrong or was used before.")


def _count_failure(session: Session, account: Account) -> None:
    account.failed_logins += 1
    over = account.failed_logins - WRONG_BEFORE_LOCK
    if over >= 0:
        account.locked_until = now() + min(LOCK_LONGEST, LOCK_SHORTEST * 2 ** min(over, 8))
        record(session, identity_of(account), "locked after wrong passwords", "account", account.name)


def _open_session(services: Services, session: Session, account: Account, user_agent: str) -> str:
    token = new_token()
    session.add(
        AdminSession(
            account_id=account.id,
            token_hash=hash_token(token),
            second_factor=account.totp_confirmed_at is not None,
            user_agent=user_agent[:300],
            expires_at=now() + timedelta(hours=services.settings.session_hours),
        )
    )
    return token


def create_account(session: Session, name: str, password: str, role: Role) -> Account:
    """Add an account; Conflict where the name is taken."""
    if _by_name(session, name) is not None:
        raise Conflict(f"There is already an account called '{name}'; choose another name.")
    account = Account(name=name, password_hash=hash_password(password, name), role=role)
    session.add(account)
    session.flush()
    record(session, identity_of(account), "account created", "account", name, role=role)
    return account


def invite(database: Database, role: Role, label: str, who: Identity | None) -> tuple[Invitation, str]:
    """Make a one-time link's token; only its hash is kept."""
    token = new_token()
    with database.write() as session:
        invitation = Invitation(
            token_hash=hash_token(token),
            role=role,
            label=label,
            created_by=who.account_id if who else None,
            expires_at=now() + timedelta(days=INVITATION_DAYS),
        )
        session.add(invitation)
        session.flush()
        record(session, who, "invited", "invitation", label, role=role)
    return invitation, token


def find_invitation(session: Session, token: str) -> Invitation:
    """The invitation of a token; NotFound where it is unknown."""
    found = session.scalar(select(Invitation).where(Invitation.token_hash == hash_token(token)))
    if found is None:
        raise NotFound("This invitation is unknown; ask for a new one.")
    return found


def accept_invitation(services: Services, token: str, name: str, password: str, user_agent: str) -> str:
    """Make the invited account and sign it in; return the session's token."""
    hash_password(password, name)  # a weak password is refused before the write lock is taken
    with services.database.write() as session:
        invitation = find_invitation(session, token)
        if invitation.used_at is not None or invitation.expires_at <= now():
            raise Conflict("This invitation was used or has expired; ask for a new one.")
        account = create_account(session, name, password, known_role(invitation.role))
        invitation.used_at = now()
        return _open_session(services, session, account, user_agent)


def known_role(word: str) -> Role:
    """The role a database row names."""
    roles: dict[str, Role] = {"viewer": "viewer", "experimenter": "experimenter", "owner": "owner"}
    return roles[word]


def change_password(services: Services, who: Identity, password: str, new_password: str) -> None:
    """Change one's own password and end every other session."""
    with services.database.read() as session:
        stored = account_of(session, who).password_hash
    _must_fit(password, stored)
    fresh = hash_password(new_password, who.name)
    with services.database.write() as session:
        account_of(session, who).password_hash = fresh
        for other in open_sessions(session, who):
            if other.id != who.session_id:
                other.revoked_at = now()
        record(session, who, "password changed", "account", who.name)


def _must_fit(password: str, stored: str) -> None:
    if not password_fits(password, stored):
        raise WrongCredentials("The present password is wrong.")


def open_sessions(session: Session, who: Identity) -> list[AdminSession]:
    """One's own sessions that are neither revoked nor expired."""
    query = select(AdminSession).where(
        AdminSession.account_id == who.account_id,
        AdminSession.revoked_at.is_(None),
        AdminSession.expires_at > now(),
    )
    return list(session.scalars(query.order_by(AdminSession.last_seen_at.desc())))


def start_second_factor(services: Services, who: Identity) -> str:
    """Give the account a fresh, unconfirmed secret and return it."""
    with services.database.write() as session:
        account = account_of(session, who)
        if account.totp_confirmed_at is not None:
            raise Conflict("A second factor is set up already; remove it first.")
        account.totp_secret = second_factor.new_seed()
        return second_factor.secret_of(services.settings.key, account.totp_secret)


def confirm_second_factor(services: Services, who: Identity, code: str) -> list[str]:
    """Turn the second factor on once the app's first code fits; return the recovery codes."""
    codes = second_factor.new_recovery_codes()
    with services.database.write() as session:
        account = account_of(session, who)
        if account.totp_secret is None or account.totp_confirmed_at is not None:
            raise Conflict("There is no second factor to confirm; start its set-up first.")
        secret = second_factor.secret_of(services.settings.key, account.totp_secret)
        step = second_factor.accepted_step(secret, code, None)
        if step is None:
            raise WrongCredentials("That code does not fit; check the clock of your phone and try again.")
        account.totp_confirmed_at, account.totp_last_step = now(), step
        account.recovery_code_hashes = [second_factor.hash_recovery_code(c) for c in codes]
        record(session, who, "second factor set up", "account", who.name)
    return codes


def remove_second_factor(services: Services, who: Identity, password: str) -> None:
    """Turn the second factor off again; asks for the password."""
    with services.database.read() as session:
        stored = account_of(session, who).password_hash
    _must_fit(password, stored)
    with services.database.write() as session:
        account = account_of(session, who)
        account.totp_secret = account.totp_confirmed_at = account.totp_last_step = None
        account.recovery_code_hashes = []
        record(session, who, "second factor removed", "account", who.name)


def change_account(
    database: Database, who: Identity, account_id: int, role: Role | None, disabled: bool | None
) -> Account:
    """Change another account's role, or disable it and end its sessions; one owner must remain."""
    with database.write() as session:
        account = session.get(Account, account_id)
        if account is None:
            raise NotFound("There is no such account.")
        account.role = role or account.role
        if disabled is not None:
            account.disabled_at = now() if disabled else None
        session.flush()
        owners = select(func.count()).where(Account.role == "owner", Account.disabled_at.is_(None))
        if not session.scalar(owners):
            raise Conflict("One owner must remain; make another account an owner first.")
        if account.disabled_at is not None:
            _end_everything(session, account.id)
        record(session, who, "account changed", "account", account.name, role=account.role, disabled=disabled)
    return account


def _end_everything(session: Session, account_id: int) -> None:
    for row in session.scalars(select(AdminSession).where(AdminSession.account_id == account_id)):
        row.revoked_at = row.revoked_at or now()
    for token in session.scalars(select(ApiToken).where(ApiToken.account_id == account_id)):
        token.revoked_at = token.revoked_at or now()
