"""Signing in, passwords, second factor, roles: the rules behind the account endpoints."""

from datetime import timedelta

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from server.accounts import repository, second_factor
from server.accounts.audit import NOBODY, record
from server.accounts.identity import Identity, account_of
from server.accounts.passwords import hash_password, password_fits
from server.accounts.tokens import end_everything
from server.clock import now
from server.context import Services
from server.db import Database
from server.errors import ApiError, Conflict, NotFound
from server.models import (
    ROLES,
    Account,
    AdminSession,
    Role,
)
from server.tokens import hash_token, new_token
from server.workspaces.repository import default_workspace, set_member
from server.workspaces.service import Place


class WrongCredentials(ApiError):
    """Name, password or code do not fit."""

    status = 401
    code = "wrong_credentials"


class SecondFactorRequired(ApiError):
    """The password fits; a code is needed too."""

    status = 401
    code = "second_factor_required"


def identity_of(account: Account, session_id: int | None = None) -> Identity:
    """The identity of an account that has just been recognised."""
    return Identity(account.id, account.name, account.role, session_id=session_id)


def accounts_exist(session: Session) -> bool:
    """False until the first account has been made."""
    return repository.any_accounts(session)


def session_of(session: Session, token: str) -> AdminSession | None:
    """The session of a cookie's value."""
    return repository.session_by_token(session, hash_token(token))


def stored_password(services: Services, name: str) -> str | None:
    """The password's hash of the account called `name`; None where there is none."""
    with services.database.read() as session:
        account = repository.account_named(session, name)
        return account.password_hash if account else None


def open_session(
    services: Services, name: str, checked: str | None, code: str | None, user_agent: str
) -> tuple[str | None, ApiError | None]:
    """After a right password: the token of a new session (the cookie's value), or why there is none.

    checked: the stored hash that the password fitted, None where it fitted none. The account is held
    meanwhile, so that a code works once however many ask at once; failures are written down too.
    """
    with services.database.write() as session:
        account = repository.account_named(session, name, lock=True)
        if account is None or account.disabled_at is not None or account.password_hash != checked:
            failure: ApiError | None = WrongCredentials("Name or password are wrong.")
        else:
            failure = _second_factor_failure(services, account, code)
        if account is not None and failure is None:
            token = begin_session(services, session, account, user_agent)
            record(session, identity_of(account), "signed in", "account", account.name)
            return token, None
        if not isinstance(failure, SecondFactorRequired):
            record_failure(services, session, account)
    return None, failure


def record_failure(services: Services, session: Session, account: Account | None) -> None:
    """Write a failed sign-in down, so many a minute; a name that is nobody's may be a password: not kept."""
    unwritten = services.sign_ins.written()
    if unwritten is None:
        return
    name = account.name if account else "(unknown)"
    details = {"not_written_before": unwritten} if unwritten else {}
    record(session, NOBODY, "sign-in failed", "account", name, **details)


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


def begin_session(services: Services, session: Session, account: Account, user_agent: str) -> str:
    """Sign an account in that has just been recognised; return the session's token."""
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
    if repository.account_named(session, name) is not None:
        raise Conflict(f"There is already an account called '{name}'; choose another name.")
    return add_account(session, name, hash_password(password, name), role)


def add_account(
    session: Session, name: str, password_hash: str, role: Role, place: Place | None = None
) -> Account:
    """Add an account whose password was hashed before; Conflict where the name is taken.

    place: where it belongs, and as what; the default workspace, in the same role, where None.
    """
    if repository.account_named(session, name) is not None:
        raise Conflict(f"There is already an account called '{name}'; choose another name.")
    account = Account(name=name, password_hash=password_hash, role=role)
    session.add(account)
    try:
        session.flush()
    except IntegrityError as error:  # somebody took it at this very moment
        raise Conflict(f"There is already an account called '{name}'; choose another name.") from error
    place = place or Place(default_workspace(session), role)
    set_member(session, place.workspace, account, place.role)
    record(
        session, identity_of(account), "account created", "account", name, role=role,
        workspace=place.workspace.name, workspace_role=place.role,
    )  # fmt: skip
    return account


def known_role(word: str) -> Role:
    """The role a database row names."""
    return ROLES[ROLES.index(word)]


def change_password(services: Services, who: Identity, fresh: str) -> None:
    """Give oneself a new password (its hash); every other session and every API token ends."""
    with services.database.write() as session:
        account_of(session, who).password_hash = fresh
        end_everything(session, who.account_id, keep_session=who.session_id)
        record(session, who, "password changed", "account", who.name)


def own_password(services: Services, who: Identity) -> str:
    """The hash of one's own password."""
    with services.database.read() as session:
        return account_of(session, who).password_hash


def must_fit(password: str, stored: str) -> None:
    """WrongCredentials where this is not the present password."""
    if not password_fits(password, stored):
        raise WrongCredentials("The present password is wrong.")


def reset_password(session: Session, name: str, fresh: str) -> None:
    """From the command line: give an account a new password (its hash); sessions and tokens end."""
    account = _named(session, name)
    account.password_hash = fresh
    end_everything(session, account.id)
    record(session, None, "password reset", "account", account.name)


def reset_second_factor(session: Session, name: str) -> None:
    """From the command line: turn an account's second factor off; sessions and tokens end."""
    account = _named(session, name)
    _without_second_factor(account)
    end_everything(session, account.id)
    record(session, None, "second factor reset", "account", account.name)


def _named(session: Session, name: str) -> Account:
    account = repository.account_named(session, name, lock=True)
    if account is None:
        names = [known.name for known in repository.accounts(session)]
        raise NotFound(f"There is no account called '{name}'{did_you_mean(name, names)}.")
    return account


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
        if (current := repository.session_of(session, who.account_id, who.session_id)) is not None:
            current.second_factor = True
        account.recovery_code_hashes = [second_factor.hash_recovery_code(c) for c in codes]
        record(session, who, "second factor set up", "account", who.name)
    return codes


def remove_second_factor(services: Services, who: Identity) -> None:
    """Turn the second factor off again; the password was asked for."""
    with services.database.write() as session:
        _without_second_factor(account_of(session, who))
        for row in repository.open_sessions(session, who.account_id):
            row.second_factor = False
        record(session, who, "second factor removed", "account", who.name)


def _without_second_factor(account: Account) -> None:
    account.totp_secret = account.totp_confirmed_at = account.totp_last_step = None
    account.recovery_code_hashes = []


def change_account(
    database: Database, who: Identity, account_id: int, role: Role | None, disabled: bool | None
) -> Account:
    """Change another account's role, or disable it and end its sessions; one owner must remain."""
    with database.write() as session:
        repository.hold_owners(session)
        account = repository.account(session, account_id, fresh=True)
        if account is None:
            raise NotFound("There is no such account.")
        account.role = role or account.role
        if disabled is not None:
            account.disabled_at = now() if disabled else None
        session.flush()
        if not repository.owners_left(session):
            raise Conflict("One owner must remain; make another account an owner first.")
        if account.disabled_at is not None:
            end_everything(session, account.id)
        record(session, who, "account changed", "account", account.name, role=account.role, disabled=disabled)
    return account


def accounts(session: Session) -> list[Account]:
    """Every account, the oldest first."""
    return repository.accounts(session)
