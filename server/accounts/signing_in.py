"""Signing in: password, second factor, and the session that it opens."""

from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts import credentials, repository
from server.accounts.audit import NOBODY, record
from server.accounts.credentials import PasswordCheck
from server.accounts.identity import Identity
from server.accounts.throttle import SignInThrottle
from server.core.db import Database
from server.core.errors import ApiError
from server.core.settings import Settings
from server.core.values import hash_token, new_token, now
from server.models import Account, AdminSession


class WrongCredentials(ApiError, status=401, code="wrong_credentials"):
    """Name, password or code do not fit."""


class WrongProof(WrongCredentials):
    """The present password, or the code in its place, does not fit."""

    audited = True


class SecondFactorRequired(ApiError, status=401, code="second_factor_required"):
    """The password fits; a code is needed too."""


def identity_of(account: Account, session_id: int | None = None) -> Identity:
    """The identity of an account that has just been recognised."""
    return Identity(account.id, account.name, account.role, session_id=session_id)


def session_of(session: Session, token: str) -> AdminSession | None:
    """The session of a cookie's value."""
    return repository.session_by_token(session, hash_token(token))


def stored_password(database: Database, name: str) -> str | None:
    """The password's hash of the account called `name`; None where there is none."""
    with database.read() as session:
        account = repository.account_named(session, name)
        return account.password_hash if account else None


def open_session(
    database: Database,
    settings: Settings,
    sign_ins: SignInThrottle,
    name: str,
    checked: PasswordCheck,
    code: str | None,
    user_agent: str,
) -> tuple[str | None, ApiError | None]:
    """After a right password: the token of a new session (the cookie's value), or why there is none.

    Parameters
    ----------
    checked : PasswordCheck
        The stored hash that the password fitted. The account is held meanwhile, so that a code works once
        however many ask at once; failures are written down too.
    """
    with database.write() as session:
        account = repository.account_named(session, name, lock=True)
        if account is None or account.disabled_at is not None or account.password_hash != checked.stored:
            failure: ApiError | None = WrongCredentials("Name or password is wrong.")
        else:
            failure = second_factor_failure(settings, account, code)
        if account is not None and failure is None:
            account.password_hash = checked.renewed or account.password_hash
            token = begin_session(settings, session, account, user_agent)
            record(session, identity_of(account), "signed in", "account", account.name)
            return token, None
        if not isinstance(failure, SecondFactorRequired):
            record_failure(sign_ins, session, account)
    return None, failure


def record_failure(sign_ins: SignInThrottle, session: Session, account: Account | None) -> None:
    """Record a failed sign-in, a limited number per minute; an unknown name may be a password: not kept."""
    unwritten = sign_ins.written()
    if unwritten is None:
        return
    name = account.name if account else "(unknown)"
    details = {"not_written_before": unwritten} if unwritten else {}
    record(session, NOBODY, "sign-in failed", "account", name, **details)


def second_factor_failure(settings: Settings, account: Account, code: str | None) -> ApiError | None:
    """Why a code is not enough; None where it fits, or none is asked for."""
    if account.totp_secret is None or account.totp_confirmed_at is None:
        return None
    if not code:
        return SecondFactorRequired("Please enter the code from your authenticator app, or a recovery code.")
    secret = credentials.secret_of(settings.key, account.totp_secret)
    step = credentials.accepted_step(secret, code, account.totp_last_step)
    if step is not None:
        account.totp_last_step = step
        return None
    hashed = credentials.hash_recovery_code(code)
    if hashed in account.recovery_code_hashes:
        account.recovery_code_hashes = [kept for kept in account.recovery_code_hashes if kept != hashed]
        return None
    return WrongCredentials("This code is wrong or was already used.")


def begin_session(
    settings: Settings,
    session: Session,
    account: Account,
    user_agent: str,
    *,
    second_factor: bool | None = None,
    provider: str | None = None,
) -> str:
    """Sign an account in that has just been recognized; return the session's token.

    Parameters
    ----------
    second_factor : bool, optional
        Whether one was given; where not said, what the account has was asked for.
    provider : str, optional
        Who recognized her; None for a password.
    """
    token = new_token()
    session.add(
        AdminSession(
            account_id=account.id,
            token_hash=hash_token(token),
            second_factor=account.totp_confirmed_at is not None if second_factor is None else second_factor,
            user_agent=user_agent[:300],
            provider=provider,
            expires_at=now() + timedelta(hours=settings.session_hours),
        )
    )
    return token
