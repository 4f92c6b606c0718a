"""Logins of accounts with providers: added, linked by somebody who is signed in, taken off again."""

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from server.accounts import repository as accounts
from server.accounts.audit import record
from server.accounts.identity import Identity, account_of
from server.accounts.signing_in import identity_of
from server.clock import now
from server.context import Services
from server.errors import Conflict, NotFound
from server.models import Account, AccountLogin, LoginAttempt
from server.providers import repository
from server.providers.protocol import Recognised
from server.providers.refusals import NotRecognised

NO_PASSWORD = ""
"""Stored where an account has none: no password has this hash."""


def add_login(session: Session, provider_id: str, account: Account, whom: Recognised) -> None:
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
        raise Conflict("This login was just used elsewhere; please begin again.") from error
    record(
        session, identity_of(account), "login added", "account", account.name,
        provider=provider_id, issuer=whom.issuer,
    )  # fmt: skip


def link(services: Services, provider_id: str, attempt: LoginAttempt, whom: Recognised) -> None:
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
            add_login(session, provider_id, asking.account, whom)


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
