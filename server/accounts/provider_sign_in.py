"""The rules of sign-in by providers: whom a subject is, who is let in, and where they belong."""

import base64
import hashlib
import hmac
import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from server.accounts import repository
from server.accounts import repository as accounts
from server.accounts import workspace_repository as workspaces
from server.accounts.access import account_of
from server.accounts.audit import NOBODY, record
from server.accounts.credentials import is_recovery_code
from server.accounts.identity import OPERATOR, Identity
from server.accounts.invitations import check_invitation, find_invitation, invited_account
from server.accounts.letters import LOGIN_ADDED, RECOVERY_CODE_USED, NoticeRecipient
from server.accounts.provider_protocol import NotRecognised, ProviderIdentity, ProviderSignOut, Secrets
from server.accounts.service import add_account
from server.accounts.signing_in import begin_session, identity_of, record_failure
from server.accounts.signing_in import second_factor_failure as code_failure
from server.accounts.throttle import SignInThrottle
from server.accounts.workspaces import Membership
from server.core.db import Database
from server.core.errors import ApiError, Conflict, NotFound
from server.core.settings import Provider, RoleRule, Settings
from server.core.values import derived_token, hash_token, new_token, now
from server.models import (
    DEFAULT_WORKSPACE,
    ROLES,
    Account,
    AccountLogin,
    Invitation,
    LoginAttempt,
    Purpose,
    Role,
    Workspace,
)

# Sign-ins by a provider that are under way: begun in a browser, kept until it comes back, ended once.

ATTEMPT_MINUTES = 10


@dataclass(frozen=True)
class SignInAttempt:
    """A sign-in under way: what goes to the provider, and what the browser keeps in its cookie."""

    secrets: Secrets
    browser: str


def provider_of(settings: Settings, provider_id: str) -> Provider:
    """The provider declared under this name; NotFound where there is none."""
    provider = settings.oidc.get(provider_id)
    if provider is None:
        raise NotFound("This server has no such sign-in service.")
    return provider


def secrets_of(key: bytes, browser: str, state: str) -> Secrets:
    """What binds a sign-in to its browser: derived from the cookie, so that no table holds it."""
    digest = hmac.new(key, f"oidc verifier:{browser}:{state}".encode(), hashlib.sha256).digest()
    verifier = base64.urlsafe_b64encode(digest).decode("ascii").rstrip("=")
    return Secrets(state, derived_token(key, "oidc nonce", f"{browser}:{state}"), verifier)


def begin_attempt(
    database: Database,
    settings: Settings,
    provider_id: str,
    purpose: Purpose,
    next_page: str,
    asking: Identity | None = None,
    invitation_hash: str | None = None,
) -> SignInAttempt:
    """Keep a sign-in that a browser begins.

    Parameters
    ----------
    asking : Identity, optional
        The account that asks for a login.
    invitation_hash : str, optional
        Of the invitation by which a new account is to be made of whom the provider recognizes.
    """
    state, browser = new_token(), new_token()
    with database.write() as session:
        repository.forget_old_attempts(session)
        store_attempt(session, provider_id, purpose, state, browser, next_page, asking, invitation_hash)
    return SignInAttempt(secrets_of(settings.key, browser, state), browser)


def store_attempt(
    session: Session,
    provider_id: str,
    purpose: Purpose,
    state: str,
    browser: str,
    next_page: str,
    asking: Identity | None,
    invitation_hash: str | None = None,
) -> None:
    """Store what a browser has begun, by the hashes of its state and cookie."""
    session.add(
        LoginAttempt(
            state_hash=hash_token(state),
            browser_hash=hash_token(browser),
            provider=provider_id,
            purpose=purpose,
            next_page=next_page,
            account_id=asking.account_id if asking else None,
            session_id=asking.session_id if asking else None,
            invitation_hash=invitation_hash,
            expires_at=now() + timedelta(minutes=ATTEMPT_MINUTES),
        )
    )


def take_attempt(database: Database, provider_id: str, state: str, browser: str) -> LoginAttempt:
    """End a sign-in under way, whatever becomes of it; NotRecognised where this browser began none.

    A state counts once, in the browser that got it, with the provider it was made for: shown to another one's
    address it is used up as well. What nobody began takes no turn to write.
    """
    with database.read() as session:
        attempt = repository.find_attempt(session, hash_token(state), hash_token(browser), "sign in", "link")
    if attempt is None or not _end_attempt(database, attempt):
        raise NotRecognised(
            "This sign-in was already finished, or started in another browser. Start it again."
        )
    if attempt.provider != provider_id:
        raise NotRecognised("This sign-in was started with another service. Start it again.")
    return attempt


def _end_attempt(database: Database, attempt: LoginAttempt) -> bool:
    """Whether it was this request that ended it, of several at once."""
    with database.write() as session:
        return repository.end_attempt(session, attempt.id)


# Logins of accounts with providers: added, linked by somebody who is signed in, taken off again.

NO_PASSWORD = ""
"""Stored where an account has none: no password has this hash."""


def add_login(session: Session, provider_id: str, account: Account, whom: ProviderIdentity) -> None:
    """Let a subject sign in to this account; Conflict where it got one elsewhere at this very moment."""
    label = whom.claims.get("name") or whom.claims.get("preferred_username") or whom.subject
    login = AccountLogin(
        account_id=account.id,
        provider=provider_id,
        issuer=whom.issuer,
        subject=whom.subject,
        label=str(label)[:100],
        last_used_at=now(),
    )
    session.add(login)
    try:
        session.flush()
    except IntegrityError as error:  # the same subject came twice at this very moment
        raise Conflict("This login was just used elsewhere. Please start again.") from error
    record(
        session, identity_of(account), "login added", "account", account.name,
        provider=provider_id, issuer=whom.issuer,
    )  # fmt: skip


def link(database: Database, provider_id: str, attempt: LoginAttempt, whom: ProviderIdentity) -> None:
    """Give the account whose open session asked for it a login, unless the subject is somebody's already."""
    with database.write() as session:
        accounts.hold(session, attempt.account_id or 0)
        asking = accounts.session_of(session, attempt.account_id or 0, attempt.session_id)
        if asking is None or asking.revoked_at or asking.expires_at <= now() or asking.account.disabled_at:
            raise NotRecognised("The session that requested this login has ended. Please sign in again.")
        login = repository.find_login(session, whom.issuer, whom.subject)
        if login is not None and login.account_id != asking.account_id:
            raise Conflict("This login belongs to another account of this server.")
        if login is None:
            add_login(session, provider_id, asking.account, whom)


def own_logins(session: Session, me: Identity) -> list[AccountLogin]:
    """The logins of the own account."""
    return repository.logins_of(session, me.account_id)


def remove_login(database: Database, me: Identity, login_id: int) -> None:
    """Take a login off one's own account, and end the other sessions that its provider began.

    Without the login the provider could not end them any more. One way to sign in must remain.
    """
    with database.write() as session:
        own = repository.logins_of(session, me.account_id)
        login = next((one for one in own if one.id == login_id), None)
        if login is None:
            raise NotFound("There is no such login.")
        if len(own) == 1 and account_of(session, me).password_hash == NO_PASSWORD:
            raise Conflict(
                "This login cannot be removed: the account has no password, so nobody could sign in."
            )
        record(session, me, "login removed", "account", me.name, provider=login.provider, issuer=login.issuer)
        session.delete(login)
        repository.end_sessions(session, me.account_id, login.provider, spared=me.session_id)


# Where somebody belongs by what a provider says of her.

log = logging.getLogger("palpebra")


def said_of(claims: Mapping[str, Any], name: str) -> Any:
    """A claim by name, or by dots through nested ones (`realm_access.roles`); None if there is none."""
    if name in claims:
        return claims[name]
    told: Any = claims
    for part in name.split("."):
        told = told.get(part) if isinstance(told, Mapping) else None
    return told


def rule_fits(rule: RoleRule, claims: Mapping[str, Any]) -> bool:
    """True where the claim is the value, or a list that holds it; always for a rule without one."""
    if not rule.claim:
        return True
    told = said_of(claims, rule.claim)
    return rule.value in told if isinstance(told, list) else told == rule.value


def roles_by_claims(provider: Provider, claims: Mapping[str, Any]) -> dict[str, Role]:
    """Workspace -> the highest role that a rule gives in it."""
    given: dict[str, Role] = {}
    for rule in provider.roles:
        if rule_fits(rule, claims):
            given[rule.workspace] = max(given.get(rule.workspace, rule.role), rule.role, key=ROLES.index)
    return given


def held_workspaces(session: Session, provider: Provider) -> dict[str, Workspace]:
    """Name -> workspace of those that the rules name, held until the transaction ends.

    So that two owners who go at once do not leave a workspace without any. They are taken in the order of
    their names and before anything is written, so that no two sign-ins wait for each other. A name that is
    nobody's is written to the log.
    """
    known = {}
    for name in sorted({rule.workspace for rule in provider.roles}):
        if (workspace := workspaces.find_workspace(session, name, lock=True)) is None:
            log.warning("a rule of a sign-in provider names the workspace '%s', which does not exist", name)
        else:
            known[name] = workspace
    return known


def bring_up_to_date(
    session: Session,
    provider_id: str,
    account: Account,
    given: Mapping[str, Role],
    held: Mapping[str, Workspace],
) -> None:
    """Give an account the roles that its claims give it, in the workspaces that the rules name.

    In those the provider decides: who has lost the claim loses the membership, but for a workspace's last
    owner.

    Parameters
    ----------
    given : mapping
        What `roles_by_claims` gives.
    held : mapping
        What `held_workspaces` gives, in this transaction.
    """
    present = workspaces.roles_of(session, account.id)
    for name, workspace in held.items():
        before, after = present.get(workspace.id), given.get(name)
        if before == after:
            continue
        if before == "owner" and workspaces.number_of_owners(session, workspace) == 1:
            log.warning(
                "'%s' remains the last owner of '%s', despite the rules of its provider", account.name, name
            )
            continue
        if after is None:
            workspaces.remove_member(session, workspace, account)
        else:
            workspaces.set_member(session, workspace, account, after)
        action = "member removed" if after is None else "member set"
        record(
            session, OPERATOR, action, "workspace", name,
            account=account.name, role=after, provider=provider_id,
        )  # fmt: skip


# Which people without a login here are let in: by a rule of the declared provider, or by an invitation.

_NOT_IN_A_NAME = re.compile(r"[^\w.@+ -]+")
MAX_NAME = 90


class NotAdmitted(ApiError, status=403, code="not_admitted"):
    """The provider knows her, this server does not."""


def new_account(
    session: Session,
    provider_id: str,
    provider: Provider,
    whom: ProviderIdentity,
    held: Mapping[str, Workspace],
) -> Account:
    """The account of somebody new, where a rule gives her a place; NotAdmitted where none does."""
    given = roles_by_claims(provider, whom.claims)
    membership = next((Membership(held[name], role) for name, role in given.items() if name in held), None)
    if membership is None:
        raise NotAdmitted(
            "This login is not linked to an account. Sign in with your password and add it, or ask an owner."
        )
    name = _free_name(session, whom.claims, provider.label)
    account = add_account(session, name, NO_PASSWORD, "viewer", membership)
    add_login(session, provider_id, account, whom)
    return account


def account_by_invitation(
    session: Session,
    provider_id: str,
    provider: Provider,
    invitation_hash: str,
    whom: ProviderIdentity,
    login: AccountLogin | None,
) -> Account:
    """The account that somebody makes by her invitation, without a password."""
    if login is not None:
        raise Conflict("This login already belongs to an account of this server. Sign in with it.")
    invitation = accounts.invitation_by_token(session, invitation_hash)
    if invitation is not None:
        check_no_rule_decides(session, provider, invitation)
    name = _free_name(session, whom.claims, provider.label)
    account = invited_account(session, invitation, name, NO_PASSWORD)
    add_login(session, provider_id, account, whom)
    return account


def check_no_rule_decides(session: Session, provider: Provider, invitation: Invitation) -> None:
    """Conflict where the provider's rules decide in the invitation's workspace: they would take it back."""
    workspace = accounts.workspace_of(session, invitation)
    name = workspace.name if workspace else DEFAULT_WORKSPACE
    if any(rule.workspace == name for rule in provider.roles):
        raise Conflict(
            f"{provider.label} manages the members of the workspace '{name}', so the invitation cannot be "
            f"used with it. Sign in without the invitation, or create an account with a password."
        )


def _free_name(session: Session, claims: Mapping[str, Any], otherwise: str) -> str:
    """A name that nobody has, made of what the provider calls her."""
    told = next(
        (claims[key] for key in ("preferred_username", "name") if isinstance(claims.get(key), str)), ""
    )
    plain = " ".join(_NOT_IN_A_NAME.sub(" ", told).split())[:MAX_NAME]
    name = plain if len(plain) > 1 else f"{_NOT_IN_A_NAME.sub(' ', otherwise).strip()} user"
    number, free = 1, name
    while accounts.account_named(session, free) is not None:
        number += 1
        free = f"{name} {number}"
    return free


# The rules of sign-in by providers: whom a subject is, and what follows when the browser comes back.


@dataclass(frozen=True)
class SignInOutcome:
    """Where the browser goes on, with the session's cookie or the one that asks for a second factor.

    Attributes
    ----------
    told : NoticeRecipient or None
        What its account is notified of by mail.
    """

    page: str
    session: str | None = None
    asks_code: str | None = None
    told: NoticeRecipient | None = None


def begin_invited(database: Database, settings: Settings, provider_id: str, token: str) -> SignInAttempt:
    """Keep a sign-in that is to make an invited account; NotFound or Conflict where it cannot."""
    check_invitation(database, token)
    with database.read() as session:
        check_no_rule_decides(session, provider_of(settings, provider_id), find_invitation(session, token))
    return begin_attempt(database, settings, provider_id, "sign in", "/", invitation_hash=hash_token(token))


# Decision 0747: External accounts are known by issuer and subject.
def finish_sign_in(
    database: Database,
    settings: Settings,
    provider_id: str,
    attempt: LoginAttempt,
    whom: ProviderIdentity,
    user_agent: str,
) -> SignInOutcome:
    """Let in whom the provider recognised, or give the account that asked for it a login."""
    if attempt.purpose == "link":
        link(database, provider_id, attempt, whom)
        return SignInOutcome("/account", told=NoticeRecipient(attempt.account_id or 0, LOGIN_ADDED))
    provider = provider_of(settings, provider_id)
    with database.write() as session:
        held = held_workspaces(session, provider)
        login = repository.find_login(session, whom.issuer, whom.subject)
        if attempt.invitation_hash is not None:
            account = account_by_invitation(
                session, provider_id, provider, attempt.invitation_hash, whom, login
            )
        elif login is not None:
            account = login.account
        else:
            account = new_account(session, provider_id, provider, whom, held)
        if account.disabled_at is not None:
            raise NotAdmitted("This account is closed. Ask an owner of this server.")
        if login is not None:
            login.last_used_at = now()
        bring_up_to_date(session, provider_id, account, roles_by_claims(provider, whom.claims), held)
        if account.totp_confirmed_at is not None and not whom.second_factor:
            state = new_token()
            store_attempt(session, provider_id, "code", state, state, attempt.next_page, identity_of(account))
            return SignInOutcome("/sign-in?code=asked", asks_code=state)
        token = begin_session(
            settings, session, account, user_agent, second_factor=whom.second_factor, provider=provider_id
        )
        record(session, identity_of(account), "signed in", "account", account.name, provider=provider_id)
    return SignInOutcome(attempt.next_page, session=token)


def finish_with_code(
    database: Database, settings: Settings, sign_ins: SignInThrottle, browser: str, code: str, user_agent: str
) -> SignInOutcome:
    """After the provider: the account's own second factor, which its session then has.

    Wrong codes are counted outside of the transaction: on PostgreSQL a count is a separate transaction.
    """
    with database.read() as session:
        name = _name_behind(session, browser)
    sign_ins.codes.check(name)
    finished, failure = _finish_held(database, settings, sign_ins, browser, code, user_agent)
    if finished is not None:
        sign_ins.codes.succeeded(name)
        return finished
    sign_ins.codes.failed(name)
    raise failure or NotRecognised("This sign-in was already finished. Please start it again.")


def _name_behind(session: Session, browser: str) -> str:
    attempt = repository.find_attempt(session, hash_token(browser), hash_token(browser), "code")
    account = accounts.account(session, attempt.account_id or 0) if attempt else None
    if account is None:
        raise _no_code_asked()
    return account.name.casefold()


def _no_code_asked() -> NotRecognised:
    return NotRecognised("This sign-in took too long or does not need a code. Please start again.")


def _finish_held(
    database: Database, settings: Settings, sign_ins: SignInThrottle, browser: str, code: str, user_agent: str
) -> tuple[SignInOutcome | None, ApiError | None]:
    """With the account held, so that a code works once however many ask at once.

    Where it has no second factor any more, no code is one. Failures are written down too.
    """
    with database.write() as session:
        attempt = repository.find_attempt(session, hash_token(browser), hash_token(browser), "code")
        account = accounts.account(session, attempt.account_id or 0, lock=True) if attempt else None
        if attempt is None or account is None or account.disabled_at or account.totp_confirmed_at is None:
            raise _no_code_asked()
        failure = code_failure(settings, account, code)
        if failure is None and repository.end_attempt(session, attempt.id):
            token = begin_session(
                settings, session, account, user_agent, second_factor=True, provider=attempt.provider
            )
            record(
                session, identity_of(account), "signed in", "account", account.name, provider=attempt.provider
            )
            told = NoticeRecipient(account.id, RECOVERY_CODE_USED) if is_recovery_code(code) else None
            return SignInOutcome(attempt.next_page, session=token, told=told), None
        record_failure(sign_ins, session, account)
    return None, failure


def sign_out(database: Database, provider_id: str, ended: ProviderSignOut) -> None:
    """End the sessions that a provider began for a subject that signed out there."""
    with database.write() as session:
        login = repository.find_login(session, ended.issuer, ended.subject)
        number = repository.end_sessions(session, login.account_id, provider_id) if login else 0
        if login is not None and number:
            record(
                session, identity_of(login.account), "signed out by provider", "account", login.account.name,
                provider=provider_id, sessions=number,
            )  # fmt: skip


def note_failure(database: Database, sign_ins: SignInThrottle, provider_id: str, refusal: ApiError) -> None:
    """Record a failed sign-in by a provider, a limited number per minute."""
    unwritten = sign_ins.written()
    if unwritten is None:
        return
    details = {"not_written_before": unwritten} if unwritten else {}
    with database.write() as session:
        record(
            session, NOBODY, "sign-in failed", "account", "(unknown)",
            provider=provider_id, reason=refusal.code, **details,
        )  # fmt: skip
