"""Accounts, passwords, second factor, roles: the rules behind the account endpoints."""

from datetime import timedelta

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from server.accounts import credentials, repository
from server.accounts.access import account_of
from server.accounts.audit import SECOND_FACTOR_SET_UP, record
from server.accounts.credentials import hash_password, password_fits
from server.accounts.identity import Identity
from server.accounts.signing_in import WrongCredentials, WrongProof, identity_of, second_factor_failure
from server.accounts.workspace_repository import default_workspace, set_member
from server.accounts.workspaces import Membership
from server.core.db import Database
from server.core.errors import ApiError, Conflict, NotFound
from server.core.settings import Settings
from server.core.values import hash_token, new_token, now
from server.models import ROLES, Account, AdminSession, ApiToken, Role

# What is open in one's own name: signed-in browsers and API tokens.


def open_sessions(session: Session, owner: Identity, idle: timedelta) -> list[AdminSession]:
    """One's own sessions that are neither revoked nor expired, nor unused for longer than `idle`."""
    return repository.open_sessions(session, owner.account_id, now() - idle)


def revoke_session(database: Database, owner: Identity, session_id: int | None) -> None:
    """Sign out a browser of this account; NotFound if it belongs to another."""
    with database.write() as session:
        row = repository.session_of(session, owner.account_id, session_id)
        if row is None:
            raise NotFound("There is no such session.")
        row.revoked_at = row.revoked_at or now()
        record(session, owner, "session ended", "session", str(session_id))


def open_tokens(session: Session, owner: Identity) -> list[ApiToken]:
    """One's own API tokens that are not revoked."""
    return [token for token in repository.tokens(session, owner.account_id) if token.revoked_at is None]


def create_token(
    session: Session, owner: Identity, name: str, scopes: list[str], days: int
) -> tuple[ApiToken, str]:
    """Make an API token and its secret, of which only the hash is kept; it ends after `days`."""
    secret = new_token()
    row = ApiToken(
        account_id=owner.account_id,
        name=name,
        token_hash=hash_token(secret),
        scopes=sorted(set(scopes)),
        expires_at=now() + timedelta(days=days),
    )
    session.add(row)
    session.flush()
    record(session, owner, "token created", "token", name, scopes=row.scopes)
    return row, secret


def revoke_token(database: Database, owner: Identity, token_id: int) -> None:
    """Revoke an API token of this account; NotFound if it belongs to another."""
    with database.write() as session:
        row = repository.token_of(session, owner.account_id, token_id)
        if row is None:
            raise NotFound("There is no such token.")
        row.revoked_at = row.revoked_at or now()
        record(session, owner, "token revoked", "token", row.name)


def end_everything(session: Session, account_id: int, keep_session: int | None = None) -> None:
    """End the sessions of an account, but for one, revoke its API tokens, and take back what is under way.

    Somebody in a stolen session may have asked for a link that makes their address the account's, or
    begun to add a login of hers.
    """
    repository.hold(session, account_id)
    for row in repository.sessions(session, account_id):
        if row.id != keep_session:
            row.revoked_at = row.revoked_at or now()
    for token in repository.tokens(session, account_id):
        token.revoked_at = token.revoked_at or now()
    repository.forget_under_way(session, account_id)


def accounts_exist(session: Session) -> bool:
    """False until the first account has been made."""
    return repository.any_accounts(session)


def create_account(session: Session, name: str, password: str, role: Role) -> Account:
    """Add an account; Conflict where the name is taken."""
    return add_account(session, name, hash_password(password, name), role)


def add_account(
    session: Session, name: str, password_hash: str, role: Role, membership: Membership | None = None
) -> Account:
    """Add an account whose password was hashed before; Conflict where the name is taken.

    Parameters
    ----------
    membership : Membership, optional
        Where it belongs, and as what; the default workspace, in the same role, where None.
    """
    taken = Conflict(f"An account called '{name}' already exists. Choose another name.")
    if repository.account_named(session, name) is not None:
        raise taken
    account = Account(name=name, password_hash=password_hash, role=role)
    session.add(account)
    try:
        session.flush()
    except IntegrityError as error:  # somebody took it at this very moment
        raise taken from error
    membership = membership or Membership(default_workspace(session), role)
    set_member(session, membership.workspace, account, membership.role)
    record(
        session, identity_of(account), "account created", "account", name, role=role,
        workspace=membership.workspace.name, workspace_role=membership.role,
    )  # fmt: skip
    return account


def known_role(word: str) -> Role:
    """The role a database row names."""
    return ROLES[ROLES.index(word)]


def change_password(database: Database, identity: Identity, fresh: str) -> None:
    """Give oneself a new password (its hash); every other session and every API token ends."""
    with database.write() as session:
        account_of(session, identity).password_hash = fresh
        end_everything(session, identity.account_id, keep_session=identity.session_id)
        record(session, identity, "password changed", "account", identity.name)


def own_password(database: Database, identity: Identity) -> str:
    """The hash of the account's password."""
    with database.read() as session:
        return account_of(session, identity).password_hash


def must_fit(password: str, stored: str) -> None:
    """WrongCredentials where this is not the present password."""
    if not stored:
        raise Conflict("This account has no password. An owner of the server can set one.")
    if not password_fits(password, stored):
        raise WrongProof("The current password is wrong.")


def own_code_failure(
    database: Database, settings: Settings, identity: Identity, code: str
) -> ApiError | None:
    """Why this is not a code of the account's second factor; None if it is, and it is used up."""
    with database.write() as session:
        account = account_of(session, identity)
        repository.hold(session, account.id)
        session.refresh(account)
        if account.totp_confirmed_at is None:
            return Conflict(
                "This account has neither a password nor a second factor. Set up a second factor first."
            )
        failure = second_factor_failure(settings, account, code)
        return WrongProof(failure.message) if isinstance(failure, WrongCredentials) else failure


def check_known(session: Session, name: str) -> None:
    """Refuse the name of no account.

    Raises
    ------
    NotFound
        With the name that comes nearest.
    """
    _account_named(session, name)


def reset_password(session: Session, name: str, fresh: str) -> tuple[int, str]:
    """From the command line: give an account a new password (its hash).

    Returns
    -------
    tuple of int and str
        The account's number, and what became of its logins.
    """
    account = _account_named(session, name)
    logins = renew(session, None, account, fresh)
    record(session, None, "password reset", "account", account.name)
    return account.id, logins


def renew(session: Session, actor: Identity | None, account: Account, fresh: str) -> str:
    """Give an account a new password (its hash) for one that is lost; sessions, tokens and logins end.

    A login may belong to a person who stole the password. The logins of an account without any password stay:
    they are how its own person signs in.

    Returns
    -------
    str
        A sentence for her about the logins; empty where there were none.
    """
    had_password, account.password_hash = account.password_hash, fresh
    end_everything(session, account.id)
    logins = repository.logins(session, account.id)
    issuers = ", ".join(sorted({login.issuer for login in logins}))
    if not logins:
        return ""
    if not had_password:
        return f"Logins from {issuers} still work; check under My account that they are yours."
    for login in logins:
        record(
            session, actor, "login removed", "account", account.name,
            provider=login.provider, issuer=login.issuer,
        )  # fmt: skip
        session.delete(login)
    return f"Logins from {issuers} were removed; add yours again under My account."


def reset_second_factor(session: Session, name: str) -> int:
    """From the command line: turn an account's second factor off, end its sessions; gives its number."""
    account = _account_named(session, name)
    _without_second_factor(session, account)
    end_everything(session, account.id)
    record(session, None, "second factor reset", "account", account.name)
    return account.id


def _account_named(session: Session, name: str) -> Account:
    account = repository.account_named(session, name, lock=True)
    if account is None:
        names = [known.name for known in repository.accounts(session)]
        raise NotFound(f"There is no account called '{name}'{did_you_mean(name, names)}.")
    return account


def start_second_factor(database: Database, settings: Settings, identity: Identity) -> str:
    """Give the account a fresh, unconfirmed secret and return it."""
    with database.write() as session:
        account = account_of(session, identity)
        if account.totp_confirmed_at is not None:
            raise Conflict("A second factor is already set up. Remove it first.")
        account.totp_secret = credentials.new_seed()
        return credentials.secret_of(settings.key, account.totp_secret)


def confirm_second_factor(database: Database, settings: Settings, identity: Identity, code: str) -> list[str]:
    """Turn the second factor on once the app's first code fits; return the recovery codes."""
    codes = credentials.new_recovery_codes()
    with database.write() as session:
        account = account_of(session, identity)
        if account.totp_secret is None or account.totp_confirmed_at is not None:
            raise Conflict("There is no second factor to confirm. Start the setup first.")
        secret = credentials.secret_of(settings.key, account.totp_secret)
        step = credentials.accepted_step(secret, code, None)
        if step is None:
            raise WrongCredentials("This code is not valid. Check the clock of your phone and try again.")
        account.totp_confirmed_at, account.totp_last_step = now(), step
        if (current := repository.session_of(session, identity.account_id, identity.session_id)) is not None:
            current.second_factor = True
        account.recovery_code_hashes = [credentials.hash_recovery_code(c) for c in codes]
        record(session, identity, SECOND_FACTOR_SET_UP, "account", identity.name)
    return codes


def remove_second_factor(database: Database, settings: Settings, identity: Identity) -> None:
    """Turn the second factor off again; the password was asked for."""
    with database.write() as session:
        _without_second_factor(session, account_of(session, identity))
        used_since = now() - settings.session_idle
        for row in repository.open_sessions(session, identity.account_id, used_since):
            row.second_factor = False
        record(session, identity, "second factor removed", "account", identity.name)


def _without_second_factor(session: Session, account: Account) -> None:
    account.totp_secret = account.totp_confirmed_at = account.totp_last_step = None
    account.recovery_code_hashes = []
    # At the question for a code, no second factor was shown yet, and there is none to show.
    repository.end_sign_ins_that_ask_for_a_code(session, account.id)


def change_account(
    database: Database, identity: Identity, account_id: int, role: Role | None, disabled: bool | None
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
            raise Conflict("At least one owner must remain. Make another account an owner first.")
        if account.disabled_at is not None:
            end_everything(session, account.id)
        record(
            session,
            identity,
            "account changed",
            "account",
            account.name,
            role=account.role,
            disabled=disabled,
        )
    return account


def accounts(session: Session) -> list[Account]:
    """Every account, the oldest first."""
    return repository.accounts(session)
