"""Sign-ins by a provider that are under way: begun in a browser, kept until it comes back, ended once."""

import base64
import hashlib
import hmac
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy.orm import Session

from server.accounts.identity import Identity
from server.clock import now
from server.context import Services
from server.errors import NotFound
from server.models import LoginAttempt, Purpose
from server.providers import repository
from server.providers.declaration import Provider
from server.providers.protocol import Secrets
from server.providers.refusals import NotRecognised
from server.tokens import derived_token, hash_token, new_token

ATTEMPT_MINUTES = 10


@dataclass(frozen=True)
class Begun:
    """A sign-in under way: what goes to the provider, and what the browser keeps in its cookie."""

    secrets: Secrets
    browser: str


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
        keep(session, provider_id, purpose, state, browser, next_page, asking, invitation_hash)
    return Begun(secrets_of(services.settings.key, browser, state), browser)


def keep(
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
