"""The rules of sign-in by providers: whom a subject is, who is let in, how an account gets a login."""

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

from server.accounts import repository as accounts
from server.accounts.audit import NOBODY, record
from server.accounts.identity import Identity, account_of
from server.accounts.invitations import check_invitation, find_invitation, invited_account
from server.accounts.service import add_account, begin_session, identity_of, record_failure
from server.accounts.service import second_factor_failure as code_failure
from server.clock import now
from server.context import Services
from server.errors import ApiError, Conflict, NotFound
from server.models import (
    DEFAULT_WORKSPACE,
    Account,
    AccountLogin,
    Invitation,
    LoginAttempt,
    Purpose,
    Workspace,
)
from server.providers import repository
from server.providers.declaration import Provider
from server.providers.protocol import NotRecognised, Recognised, Secrets, SignedOut
from server.providers.roles import bring_up_to_date, held_workspaces, roles_by_claims
from server.tokens import derived_token, hash_token, new_token
from server.workspaces.service import Membership

log = logging.getLogger("palpebra")
ATTEMPT_MINUTES = 10
NO_PASSWORD = ""
"""Stored where an account has none: no password has this hash."""
_NOT_IN_A_NAME = re.compile(r"[^\w.@+ -]+")
MAX_NAME = 90


class NotAdmitted(ApiError):
    """The provider knows her, this server does not."""

    status = 403
    code = "not_admitted"


@dataclass(frozen=True)
class Begun:
    """A sign-in under way: what goes to the provider, and what the browser keeps in its cookie."""

    secrets: Secrets
    browser: str


@dataclass(frozen=True)
class Finished:
    """Where the browser goes on, with the session's cookie or the one that asks for a second factor."""

    page: str
    session: str | None = None
    asks_code: str | None = None


def provider_of(services: Services, provider_id: str) -> Provider:
    """The provider declared under this name; NotFound where there is none."""
    provider = services.settings.oidc.get(provider_id)
    if provider is None:
        raise NotFound("There is no such service to sign in with here.")
    return provider


def secrets_of(key: bytes, browser: str, state: str) -> Secrets:
    """What binds a sign-in to its browser: derived from the cookie, so that no table holds it."""
    digest = hmac.new(key, f"oidc verifier:{browser}:{state}".encode(), hashlib.sha256).digest()
    verifier = base64.urlsafe_b64encode(digest).decode("ascii").rstrip("=")
    return Secrets(state, derived_token(key, "oidc nonce", f"{browser}:{state}"), verifier)


def begin(
    services: Services,
    provider_id: str,
    purpose: Purpose,
    next_page: str,
    asking: Identity | None = None,
    invitation_hash: str | None = None,
) -> Begun:
    """Keep a sign-in that a browser begins.

    Parameters
    ----------
    asking : Identity, optional
        Who wants a login of her own account.
    invitation_hash : str, optional
        Of the invitation by which a new account is to be made of whom the provider recognises.
    """
    state, browser = new_token(), new_token()
    with services.database.write() as session:
        repository.forget_old_attempts(session)
        _keep(session, provider_id, purpose, state, browser, next_page, asking, invitation_hash)
    return Begun(secrets_of(services.settings.key, browser, state), browser)


def begin_invited(services: Services, provider_id: str, token: str) -> Begun:
    """Keep a sign-in that is to make an invited account; NotFound or Conflict where it cannot."""
    check_invitation(services, token)
    with services.database.read() as session:
        _check_no_rule_decides(session, provider_of(services, provider_id), find_invitation(session, token))
    return begin(services, provider_id, "sign in", "/", invitation_hash=hash_token(token))


def _keep(
    session: Session,
    provider_id: str,
    purpose: Purpose,
    state: str,
    browser: str,
    next_page: str,
    asking: Identity | None,
    invitation_hash: str | None = None,
) -> None:
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


def take(services: Services, provider_id: str, state: str, browser: str) -> LoginAttempt:
    """End a sign-in under way, whatever becomes of it; NotRecognised where this browser began none.

    A state counts once, in the browser that got it, with the provider it was made for: shown to another one's
    address it is used up as well. What nobody began takes no turn to write.
    """
    with services.database.read() as session:
        attempt = repository.attempt(session, hash_token(state), hash_token(browser), "sign in", "link")
    if attempt is None or not _ended(services, attempt):
        raise NotRecognised("This sign-in was finished before, or begun in another browser.")
    if attempt.provider != provider_id:
        raise NotRecognised("This sign-in was begun with another service.")
    return attempt


def _ended(services: Services, attempt: LoginAttempt) -> bool:
    """Whether it was this request that ended it, of several at once."""
    with services.database.write() as session:
        return repository.end_attempt(session, attempt.id)


def finish(
    services: Services, provider_id: str, attempt: LoginAttempt, whom: Recognised, user_agent: str
) -> Finished:
    """Let in whom the provider recognised, or give the account that asked for it a login."""
    if attempt.purpose == "link":
        return _link(services, provider_id, attempt, whom)
    provider = provider_of(services, provider_id)
    with services.database.write() as session:
        held = held_workspaces(session, provider)
        login = repository.login(session, whom.issuer, whom.subject)
        if attempt.invitation_hash is not None:
            account = _invited(session, provider_id, provider, attempt.invitation_hash, whom, login)
        elif login is not None:
            account = login.account
        else:
            account = _new_account(session, provider_id, provider, whom, held)
        if account.disabled_at is not None:
            raise NotAdmitted("This account is closed; ask an owner of this server.")
        if login is not None:
            login.last_used_at = now()
        bring_up_to_date(session, provider_id, account, roles_by_claims(provider, whom.claims), held)
        if account.totp_confirmed_at is not None and not whom.second_factor:
            state = new_token()
            _keep(session, provider_id, "code", state, state, attempt.next_page, identity_of(account))
            return Finished("/sign-in?code=asked", asks_code=state)
        token = begin_session(
            services, session, account, user_agent, second_factor=whom.second_factor, provider=provider_id
        )
        record(session, identity_of(account), "signed in", "account", account.name, provider=provider_id)
    return Finished(attempt.next_page, session=token)


def finish_with_code(services: Services, browser: str, code: str, user_agent: str) -> Finished:
    """After the provider: the account's own second factor, which its session then has.

    The account is held meanwhile, so that a code works once however many ask at once; where it has no second
    factor any more, no code is one.
    """
    with services.database.write() as session:
        attempt = repository.attempt(session, hash_token(browser), hash_token(browser), "code")
        account = accounts.account(session, attempt.account_id or 0, lock=True) if attempt else None
        if attempt is None or account is None or account.disabled_at or account.totp_confirmed_at is None:
            raise NotRecognised("This sign-in has taken too long or asks for no code; please begin again.")
        name = account.name.casefold()
        services.sign_ins.codes.check(name)
        failure = code_failure(services, account, code)
        if failure is None and repository.end_attempt(session, attempt.id):
            services.sign_ins.codes.succeeded(name)
            token = begin_session(
                services, session, account, user_agent, second_factor=True, provider=attempt.provider
            )
            record(
                session, identity_of(account), "signed in", "account", account.name, provider=attempt.provider
            )
            return Finished(attempt.next_page, session=token)
        services.sign_ins.codes.failed(name)
        record_failure(services, session, account)
    raise failure or NotRecognised("This sign-in was finished before; please begin it again.")


def _new_account(
    session: Session, provider_id: str, provider: Provider, whom: Recognised, held: Mapping[str, Workspace]
) -> Account:
    """The account of somebody new, where a rule gives her a place; NotAdmitted where none does."""
    given = roles_by_claims(provider, whom.claims)
    membership = next((Membership(held[name], role) for name, role in given.items() if name in held), None)
    if membership is None:
        raise NotAdmitted("Nobody here belongs to this login yet: sign in by password and add it, or ask.")
    name = _free_name(session, whom.claims, provider.label)
    account = add_account(session, name, NO_PASSWORD, "viewer", membership)
    _add_login(session, provider_id, account, whom)
    return account


def _invited(
    session: Session,
    provider_id: str,
    provider: Provider,
    invitation_hash: str,
    whom: Recognised,
    login: AccountLogin | None,
) -> Account:
    """The account that somebody makes by her invitation, without a password."""
    if login is not None:
        raise Conflict("This login belongs to an account of this server already: sign in by it.")
    invitation = accounts.invitation_by_token(session, invitation_hash)
    if invitation is not None:
        _check_no_rule_decides(session, provider, invitation)
    name = _free_name(session, whom.claims, provider.label)
    account = invited_account(session, invitation, name, NO_PASSWORD)
    _add_login(session, provider_id, account, whom)
    return account


def _check_no_rule_decides(session: Session, provider: Provider, invitation: Invitation) -> None:
    """Conflict where the provider's rules decide in the invitation's workspace: they would take it back."""
    workspace = accounts.workspace_of(session, invitation)
    name = workspace.name if workspace else DEFAULT_WORKSPACE
    if any(rule.workspace == name for rule in provider.roles):
        raise Conflict(
            f"{provider.label} says who belongs to the workspace '{name}', not an invitation: sign in with it"
            " without the invitation, or make the account with a password."
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


def _add_login(session: Session, provider_id: str, account: Account, whom: Recognised) -> None:
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
        raise Conflict("This login was just used elsewhere; please begin again.") from error
    record(
        session, identity_of(account), "login added", "account", account.name,
        provider=provider_id, issuer=whom.issuer,
    )  # fmt: skip


def _link(services: Services, provider_id: str, attempt: LoginAttempt, whom: Recognised) -> Finished:
    """Give the account whose open session asked for it a login, unless the subject is somebody's already."""
    with services.database.write() as session:
        accounts.hold(session, attempt.account_id or 0)
        asking = accounts.session_of(session, attempt.account_id or 0, attempt.session_id)
        if asking is None or asking.revoked_at or asking.expires_at <= now() or asking.account.disabled_at:
            raise NotRecognised("The session that asked for this login has ended; please sign in again.")
        login = repository.login(session, whom.issuer, whom.subject)
        if login is not None and login.account_id != asking.account_id:
            raise Conflict("This login belongs to another account of this server.")
        if login is None:
            _add_login(session, provider_id, asking.account, whom)
    return Finished("/account")


def sign_out(services: Services, provider_id: str, ended: SignedOut) -> None:
    """End the sessions that a provider began for a subject that signed out there."""
    with services.database.write() as session:
        login = repository.login(session, ended.issuer, ended.subject)
        number = repository.end_sessions(session, login.account_id, provider_id) if login else 0
        if login is not None and number:
            record(
                session, identity_of(login.account), "signed out by provider", "account", login.account.name,
                provider=provider_id, sessions=number,
            )  # fmt: skip


def failed(services: Services, provider_id: str, refusal: ApiError) -> None:
    """Write a sign-in by a provider down that came to nothing, so many a minute."""
    unwritten = services.sign_ins.written()
    if unwritten is None:
        return
    details = {"not_written_before": unwritten} if unwritten else {}
    with services.database.write() as session:
        record(
            session, NOBODY, "sign-in failed", "account", "(unknown)",
            provider=provider_id, reason=refusal.code, **details,
        )  # fmt: skip


def own_logins(session: Session, me: Identity) -> list[AccountLogin]:
    """The logins of one's own account."""
    return repository.logins_of(session, me.account_id)


def remove_login(services: Services, me: Identity, login_id: int) -> None:
    """Take a login off one's own account, and end the other sessions that its provider began.

    Without the login the provider could not end them any more. One way to sign in must remain.
    """
    with services.database.write() as session:
        own = repository.logins_of(session, me.account_id)
        login = next((one for one in own if one.id == login_id), None)
        if login is None:
            raise NotFound("There is no such login.")
        if len(own) == 1 and account_of(session, me).password_hash == NO_PASSWORD:
            raise Conflict("Without this login nobody could sign in to the account; it has no password.")
        record(session, me, "login removed", "account", me.name, provider=login.provider, issuer=login.issuer)
        session.delete(login)
        repository.end_sessions(session, me.account_id, login.provider, spared=me.session_id)
