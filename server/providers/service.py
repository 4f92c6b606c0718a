"""The rules of sign-in by providers: whom a subject is, and what follows when the browser comes back."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from server.accounts import repository as accounts
from server.accounts.audit import NOBODY, record
from server.accounts.invitations import check_invitation, find_invitation
from server.accounts.notices import LOGIN_ADDED, RECOVERY_CODE_USED, Told
from server.accounts.second_factor import is_recovery_code
from server.accounts.signing_in import begin_session, identity_of, record_failure
from server.accounts.signing_in import second_factor_failure as code_failure
from server.clock import now
from server.context import Services
from server.errors import ApiError
from server.models import LoginAttempt
from server.providers import repository
from server.providers.admission import (
    NotAdmitted,
    account_by_invitation,
    check_no_rule_decides,
    new_account,
)
from server.providers.attempts import Begun, begin, keep, provider_of
from server.providers.logins import link
from server.providers.protocol import Recognised, SignedOut
from server.providers.refusals import NotRecognised
from server.providers.roles import bring_up_to_date, held_workspaces, roles_by_claims
from server.tokens import hash_token, new_token


@dataclass(frozen=True)
class Finished:
    """Where the browser goes on, with the session's cookie or the one that asks for a second factor.

    Attributes
    ----------
    told : Told or None
        What its account is told by mail.
    """

    page: str
    session: str | None = None
    asks_code: str | None = None
    told: Told | None = None


def begin_invited(services: Services, provider_id: str, token: str) -> Begun:
    """Keep a sign-in that is to make an invited account; NotFound or Conflict where it cannot."""
    check_invitation(services, token)
    with services.database.read() as session:
        check_no_rule_decides(session, provider_of(services, provider_id), find_invitation(session, token))
    return begin(services, provider_id, "sign in", "/", invitation_hash=hash_token(token))


def finish(
    services: Services, provider_id: str, attempt: LoginAttempt, whom: Recognised, user_agent: str
) -> Finished:
    """Let in whom the provider recognised, or give the account that asked for it a login."""
    if attempt.purpose == "link":
        link(services, provider_id, attempt, whom)
        return Finished("/account", told=Told(attempt.account_id or 0, LOGIN_ADDED))
    provider = provider_of(services, provider_id)
    with services.database.write() as session:
        held = held_workspaces(session, provider)
        login = repository.login(session, whom.issuer, whom.subject)
        if attempt.invitation_hash is not None:
            account = account_by_invitation(
                session, provider_id, provider, attempt.invitation_hash, whom, login
            )
        elif login is not None:
            account = login.account
        else:
            account = new_account(session, provider_id, provider, whom, held)
        if account.disabled_at is not None:
            raise NotAdmitted("This account is closed; ask an owner of this server.")
        if login is not None:
            login.last_used_at = now()
        bring_up_to_date(session, provider_id, account, roles_by_claims(provider, whom.claims), held)
        if account.totp_confirmed_at is not None and not whom.second_factor:
            state = new_token()
            keep(session, provider_id, "code", state, state, attempt.next_page, identity_of(account))
            return Finished("/sign-in?code=asked", asks_code=state)
        token = begin_session(
            services, session, account, user_agent, second_factor=whom.second_factor, provider=provider_id
        )
        record(session, identity_of(account), "signed in", "account", account.name, provider=provider_id)
    return Finished(attempt.next_page, session=token)


def finish_with_code(services: Services, browser: str, code: str, user_agent: str) -> Finished:
    """After the provider: the account's own second factor, which its session then has.

    Wrong codes are counted outside of the transaction: on PostgreSQL a count is a transaction of its own.
    """
    with services.database.read() as session:
        name = _name_behind(session, browser)
    services.sign_ins.codes.check(name)
    finished, failure = _finish_held(services, browser, code, user_agent)
    if finished is not None:
        services.sign_ins.codes.succeeded(name)
        return finished
    services.sign_ins.codes.failed(name)
    raise failure or NotRecognised("This sign-in was finished before; please begin it again.")


def _name_behind(session: Session, browser: str) -> str:
    attempt = repository.attempt(session, hash_token(browser), hash_token(browser), "code")
    account = accounts.account(session, attempt.account_id or 0) if attempt else None
    if account is None:
        raise _no_code_asked()
    return account.name.casefold()


def _no_code_asked() -> NotRecognised:
    return NotRecognised("This sign-in has taken too long or asks for no code; please begin again.")


def _finish_held(
    services: Services, browser: str, code: str, user_agent: str
) -> tuple[Finished | None, ApiError | None]:
    """With the account held, so that a code works once however many ask at once.

    Where it has no second factor any more, no code is one. Failures are written down too.
    """
    with services.database.write() as session:
        attempt = repository.attempt(session, hash_token(browser), hash_token(browser), "code")
        account = accounts.account(session, attempt.account_id or 0, lock=True) if attempt else None
        if attempt is None or account is None or account.disabled_at or account.totp_confirmed_at is None:
            raise _no_code_asked()
        failure = code_failure(services, account, code)
        if failure is None and repository.end_attempt(session, attempt.id):
            token = begin_session(
                services, session, account, user_agent, second_factor=True, provider=attempt.provider
            )
            record(
                session, identity_of(account), "signed in", "account", account.name, provider=attempt.provider
            )
            told = Told(account.id, RECOVERY_CODE_USED) if is_recovery_code(code) else None
            return Finished(attempt.next_page, session=token, told=told), None
        record_failure(services, session, account)
    return None, failure


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
