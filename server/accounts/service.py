"""Signing in, invitations, second factor, tokens: the rules behind the account endpoints."""

from datetime import timedelta
from typing import Any, cast

from sqlalchemy import CursorResult, func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from experiments.errors import did_you_mean
from server.accounts import second_factor
from server.accounts.audit import NOBODY, record
from server.accounts.identity import Identity, account_of
from server.accounts.passwords import hash_password, password_fits
from server.clock import now
from server.context import Services
from server.db import Database
from server.errors import ApiError, Conflict, NotFound
from server.models import (
    DEFAULT_WORKSPACE,
    ROLES,
    Account,
    AdminSession,
    ApiToken,
    Invitation,
    Role,
    Workspace,
)
from server.tokens import hash_token, new_token
from server.workspaces.repository import default_workspace, set_member
from server.workspaces.service import Place, find_workspace

INVITATION_DAYS = 7
INVITATION_USED = Conflict("This invitation was used or has expired; ask for a new one.")


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
    return bool(session.scalar(select(func.count()).select_from(Account)))


def stored_password(services: Services, name: str) -> str | None:
    """The password's hash of the account called `name`; None where there is none."""
    with services.database.read() as session:
        account = _by_name(session, name)
        return account.password_hash if account else None


def open_session(
    services: Services, name: str, checked: str | None, code: str | None, user_agent: str
) -> tuple[str | None, ApiError | None]:
    """After a right password: the token of a new session (the cookie's value), or why there is none.

    checked: the stored hash that the password fitted, None where it fitted none. The account is held
    meanwhile, so that a code works once however many ask at once; failures are written down too.
    """
    with services.database.write() as session:
        account = _by_name(session, name, lock=True)
        if account is None or account.disabled_at is not None or account.password_hash != checked:
            failure: ApiError | None = WrongCredentials("Name or password are wrong.")
        else:
            failure = _second_factor_failure(services, account, code)
        if account is not None and failure is None:
            token = _open_session(services, session, account, user_agent)
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


def _by_name(session: Session, name: str, *, lock: bool = False) -> Account | None:
    query = select(Account).where(func.lower(Account.name) == name.lower())
    return session.scalar(query.with_for_update() if lock else query)


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
    return add_account(session, name, hash_password(password, name), role)


def add_account(
    session: Session, name: str, password_hash: str, role: Role, place: Place | None = None
) -> Account:
    """Add an account whose password was hashed before; Conflict where the name is taken.

    place: where it belongs, and as what; the default workspace, in the same role, where None.
    """
    if _by_name(session, name) is not None:
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


def invite(
    database: Database,
    role: Role,
    label: str,
    who: Identity | None,
    workspace: str | None = None,
    workspace_role: Role | None = None,
) -> tuple[Invitation, str]:
    """Make a one-time link's token; only its hash is kept. For the arguments see `Invitation`."""
    token = new_token()
    with database.write() as session:
        belongs = find_workspace(session, workspace) if workspace is not None else None
        invitation = Invitation(
            token_hash=hash_token(token),
            role=role,
            workspace_id=belongs.id if belongs else None,
            workspace_role=workspace_role,
            label=label,
            created_by=who.account_id if who else None,
            expires_at=now() + timedelta(days=INVITATION_DAYS),
        )
        session.add(invitation)
        session.flush()
        record(
            session, who, "invited", "invitation", label, role=role, workspace=workspace or DEFAULT_WORKSPACE
        )
    return invitation, token


def find_invitation(session: Session, token: str) -> Invitation:
    """The invitation of a token; NotFound where it is unknown."""
    found = session.scalar(select(Invitation).where(Invitation.token_hash == hash_token(token)))
    if found is None:
        raise NotFound("This invitation is unknown; ask for a new one.")
    return found


def check_invitation(services: Services, token: str) -> None:
    """NotFound or Conflict where a one-time link does not work, before a password is hashed for it."""
    with services.database.read() as session:
        _must_be_open(find_invitation(session, token))


def _must_be_open(invitation: Invitation) -> None:
    if invitation.used_at is not None or invitation.expires_at <= now():
        raise INVITATION_USED


def accept_invitation(services: Services, token: str, name: str, password_hash: str, user_agent: str) -> str:
    """Make the invited account and sign it in; return the session's token."""
    with services.database.write() as session:
        invitation = find_invitation(session, token)
        # One statement decides, so that of many who come at once one is let in, whatever the database.
        used = (
            update(Invitation)
            .where(
                Invitation.id == invitation.id, Invitation.used_at.is_(None), Invitation.expires_at > now()
            )
            .values(used_at=now())
        )
        if cast(CursorResult[Any], session.execute(used)).rowcount != 1:
            raise INVITATION_USED
        role = known_role(invitation.role)
        belongs = session.get(Workspace, invitation.workspace_id) if invitation.workspace_id else None
        place = Place(
            belongs or default_workspace(session), known_role(invitation.workspace_role or invitation.role)
        )
        account = add_account(session, name, password_hash, role, place)
        return _open_session(services, session, account, user_agent)


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
    account = _by_name(session, name, lock=True)
    if account is None:
        names = list(session.scalars(select(Account.name)))
        raise NotFound(f"There is no account called '{name}'{did_you_mean(name, names)}.")
    return account


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
        if (current := session.get(AdminSession, who.session_id)) is not None:
            current.second_factor = True
        account.recovery_code_hashes = [second_factor.hash_recovery_code(c) for c in codes]
        record(session, who, "second factor set up", "account", who.name)
    return codes


def remove_second_factor(services: Services, who: Identity) -> None:
    """Turn the second factor off again; the password was asked for."""
    with services.database.write() as session:
        _without_second_factor(account_of(session, who))
        for row in open_sessions(session, who):
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
        # All owners are held: two who demote each other at once would leave none.
        session.scalars(select(Account.id).where(Account.role == "owner").with_for_update()).all()
        account = session.get(Account, account_id, populate_existing=True)
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
            end_everything(session, account.id)
        record(session, who, "account changed", "account", account.name, role=account.role, disabled=disabled)
    return account


def end_everything(session: Session, account_id: int, keep_session: int | None = None) -> None:
    """End the sessions of an account, but for one, and revoke its API tokens."""
    for row in session.scalars(select(AdminSession).where(AdminSession.account_id == account_id)):
        if row.id != keep_session:
            row.revoked_at = row.revoked_at or now()
    for token in session.scalars(select(ApiToken).where(ApiToken.account_id == account_id)):
        token.revoked_at = token.revoked_at or now()
