"""Accounts, passwords, second factor, roles: the rules behind the account endpoints."""

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from server.accounts import repository, second_factor
from server.accounts.audit import SECOND_FACTOR_SET_UP, record
from server.accounts.identity import Identity, account_of
from server.accounts.passwords import hash_password, password_fits
from server.accounts.signing_in import WrongCredentials, WrongProof, identity_of, second_factor_failure
from server.accounts.tokens import end_everything
from server.clock import now
from server.context import Services
from server.db import Database
from server.errors import ApiError, Conflict, NotFound
from server.models import ROLES, Account, Role
from server.workspaces.repository import default_workspace, set_member
from server.workspaces.service import Membership


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
    taken = Conflict(f"There is already an account called '{name}'; choose another name.")
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


def change_password(services: Services, identity: Identity, fresh: str) -> None:
    """Give oneself a new password (its hash); every other session and every API token ends."""
    with services.database.write() as session:
        account_of(session, identity).password_hash = fresh
        end_everything(session, identity.account_id, keep_session=identity.session_id)
        record(session, identity, "password changed", "account", identity.name)


def own_password(services: Services, identity: Identity) -> str:
    """The hash of one's own password."""
    with services.database.read() as session:
        return account_of(session, identity).password_hash


def must_fit(password: str, stored: str) -> None:
    """WrongCredentials where this is not the present password."""
    if not stored:
        raise Conflict("This account has no password; an owner of the server can give it one.")
    if not password_fits(password, stored):
        raise WrongProof("The present password is wrong.")


def own_code_failure(services: Services, identity: Identity, code: str) -> ApiError | None:
    """Why this is no code of one's own second factor; None where it is, and so is used up."""
    with services.database.write() as session:
        account = account_of(session, identity)
        repository.hold(session, account.id)
        session.refresh(account)
        if account.totp_confirmed_at is None:
            return Conflict(
                "This account has neither password nor second factor; set up a second factor first."
            )
        failure = second_factor_failure(services, account, code)
        return WrongProof(failure.message) if isinstance(failure, WrongCredentials) else failure


def check_known(session: Session, name: str) -> None:
    """Refuse the name of no account.

    Raises
    ------
    NotFound
        With the name that comes nearest.
    """
    _named(session, name)


def reset_password(session: Session, name: str, fresh: str) -> tuple[int, str]:
    """From the command line: give an account a new password (its hash).

    Returns
    -------
    tuple of int and str
        The account's number, and what became of its logins.
    """
    account = _named(session, name)
    logins = renew(session, None, account, fresh)
    record(session, None, "password reset", "account", account.name)
    return account.id, logins


def renew(session: Session, actor: Identity | None, account: Account, fresh: str) -> str:
    """Give an account a new password (its hash) for one that is lost; sessions, tokens and logins end.

    A login may be that of whoever stole the password. The logins of an account without any password stay:
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
        return f"It is signed in to by {issuers} as before; see under My account that the logins are yours."
    for login in logins:
        record(
            session, actor, "login removed", "account", account.name,
            provider=login.provider, issuer=login.issuer,
        )  # fmt: skip
        session.delete(login)
    return f"Its logins by {issuers} are removed; add your own again under My account."


def reset_second_factor(session: Session, name: str) -> int:
    """From the command line: turn an account's second factor off, end its sessions; gives its number."""
    account = _named(session, name)
    _without_second_factor(session, account)
    end_everything(session, account.id)
    record(session, None, "second factor reset", "account", account.name)
    return account.id


def _named(session: Session, name: str) -> Account:
    account = repository.account_named(session, name, lock=True)
    if account is None:
        names = [known.name for known in repository.accounts(session)]
        raise NotFound(f"There is no account called '{name}'{did_you_mean(name, names)}.")
    return account


def start_second_factor(services: Services, identity: Identity) -> str:
    """Give the account a fresh, unconfirmed secret and return it."""
    with services.database.write() as session:
        account = account_of(session, identity)
        if account.totp_confirmed_at is not None:
            raise Conflict("A second factor is set up already; remove it first.")
        account.totp_secret = second_factor.new_seed()
        return second_factor.secret_of(services.settings.key, account.totp_secret)


def confirm_second_factor(services: Services, identity: Identity, code: str) -> list[str]:
    """Turn the second factor on once the app's first code fits; return the recovery codes."""
    codes = second_factor.new_recovery_codes()
    with services.database.write() as session:
        account = account_of(session, identity)
        if account.totp_secret is None or account.totp_confirmed_at is not None:
            raise Conflict("There is no second factor to confirm; start its set-up first.")
        secret = second_factor.secret_of(services.settings.key, account.totp_secret)
        step = second_factor.accepted_step(secret, code, None)
        if step is None:
            raise WrongCredentials("That code does not fit; check the clock of your phone and try again.")
        account.totp_confirmed_at, account.totp_last_step = now(), step
        if (current := repository.session_of(session, identity.account_id, identity.session_id)) is not None:
            current.second_factor = True
        account.recovery_code_hashes = [second_factor.hash_recovery_code(c) for c in codes]
        record(session, identity, SECOND_FACTOR_SET_UP, "account", identity.name)
    return codes


def remove_second_factor(services: Services, identity: Identity) -> None:
    """Turn the second factor off again; the password was asked for."""
    with services.database.write() as session:
        _without_second_factor(session, account_of(session, identity))
        used_since = now() - services.settings.session_idle
        for row in repository.open_sessions(session, identity.account_id, used_since):
            row.second_factor = False
        record(session, identity, "second factor removed", "account", identity.name)


def _without_second_factor(session: Session, account: Account) -> None:
    account.totp_secret = account.totp_confirmed_at = account.totp_last_step = None
    account.recovery_code_hashes = []
    # Who stands before the question for a code has shown no second factor, and there is none to show.
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
            raise Conflict("One owner must remain; make another account an owner first.")
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
