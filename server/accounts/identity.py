"""Who is asking: a signed-in browser or an API token; what each may do stands in `permission`."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final
from urllib.parse import urlsplit

from fastapi import Request
from sqlalchemy.orm import Session

from server.accounts import repository
from server.clock import now
from server.context import Services
from server.errors import ApiError
from server.models import Account, AdminSession
from server.row_security_repository import act_for
from server.tokens import hash_token

COOKIE = "palpebra_session"
_SEEN_EVERY = timedelta(minutes=1)
_NO_SUCH = "This API token is unknown, revoked or expired; make a new one."


class NotSignedIn(ApiError):
    """The request carries no valid session or token."""

    status = 401
    code = "not_signed_in"


class UnknownToken(NotSignedIn):
    """The session's cookie or the API token is nobody's."""

    audited = True


class NotAllowed(ApiError):
    """The account's role or the token's scope is not enough."""

    status = 403
    code = "not_allowed"
    audited = True


@dataclass(frozen=True)
class Identity:
    """The account behind a request; `session_id` for a browser, `scopes` for a token.

    Attributes
    ----------
    role : str
        On the server; what may be done with a study is asked by `server.studies.lookup.find_study`.
    held_back : bool
        An owner who is no more than an experimenter until she signs in with a second factor.
    second_factor : bool
        The session began with one, or the token's account has one.
    signed_in_at : datetime or None
        When the browser's session began; None for a token.
    """

    account_id: int
    name: str
    role: str
    session_id: int | None = None
    scopes: frozenset[str] | None = None
    second_factor: bool = False
    signed_in_at: datetime | None = None
    held_back: bool = False

    @property
    def sees_persons(self) -> bool:
        """True for browsers, and for tokens with the scope `personal`."""
        return self.scopes is None or "personal" in self.scopes


class Operator:
    """Whoever has the machine: the command line and the server's own work. Every study is open to her."""

    account_id: Final = None
    name: Final = "command line"


OPERATOR: Final = Operator()


def check_origin(request: Request, services: Services) -> None:
    """Refuse a change that another site's page asks for with this browser's cookie.

    Every browser says where a change comes from, by Origin or by Sec-Fetch-Site. With a session's cookie a
    request that says neither is refused: something removed them on its way. Programs use an API token.
    """
    if request.method in ("GET", "HEAD", "OPTIONS"):
        return
    origin = request.headers.get("origin")
    if origin is None:
        site = request.headers.get("sec-fetch-site")
        if site in ("same-origin", "none"):
            return
        if site is None and COOKIE not in request.cookies:
            return
        if site is None:
            raise NotAllowed(
                "This change is refused: neither Origin nor Sec-Fetch-Site says where it comes from. A "
                "program needs an API token instead of the cookie."
            )
        raise NotAllowed("This change was asked for by another site and is refused.")
    own = {services.settings.public_url, f"{request.url.scheme}://{request.headers.get('host', '')}"}
    if _address_of(origin) not in own:
        raise NotAllowed(f"This change was asked for by another site ({origin[:100]}) and is refused.")


def _address_of(origin: str) -> str:
    """Scheme and host of an origin; empty where it is no address."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return ""
    return f"{parts.scheme}://{parts.netloc}"


def identify(request: Request, services: Services) -> Identity:
    """The identity of a request, which acts for it from here on; NotSignedIn where there is none."""
    identity = _recognised(request, services)
    needed = services.settings.owners_second_factor and identity.role == "owner"
    if needed and not identity.second_factor:
        identity = replace(identity, role="experimenter", held_back=True)
    act_for(identity.account_id)
    request.state.identity = identity
    return identity


def _recognised(request: Request, services: Services) -> Identity:
    authorization = request.headers.get("authorization", "")
    if authorization.startswith("Bearer "):
        return _by_token(services, authorization.removeprefix("Bearer ").strip())
    cookie = request.cookies.get(COOKIE)
    if not cookie:
        raise NotSignedIn("Please sign in.")
    check_origin(request, services)
    return _by_cookie(services, cookie)


def _by_cookie(services: Services, cookie: str) -> Identity:
    with services.database.read() as session:
        signed_in = repository.session_by_token(session, hash_token(cookie))
        since = now() - services.settings.session_idle
        if signed_in is None:
            raise UnknownToken("Your session has ended; please sign in again.")
        if _has_ended(signed_in, since) or signed_in.account.disabled_at:
            raise NotSignedIn("Your session has ended; please sign in again.")
        account = signed_in.account
        identity = Identity(
            account.id,
            account.name,
            account.role,
            session_id=signed_in.id,
            second_factor=signed_in.second_factor,
            signed_in_at=signed_in.created_at,
        )
        stale = now() - signed_in.last_seen_at > _SEEN_EVERY
    if stale:
        with services.database.write() as session:
            if (row := repository.session_of(session, identity.account_id, identity.session_id)) is not None:
                row.last_seen_at = now()
    return identity


def _has_ended(signed_in: AdminSession, idle_since: datetime) -> bool:
    """Whether a session was ended, is too old, or was not used since."""
    return bool(signed_in.revoked_at or signed_in.expires_at <= now() or signed_in.last_seen_at <= idle_since)


def _by_token(services: Services, secret: str) -> Identity:
    with services.database.read() as session:
        token = repository.token_by_hash(session, hash_token(secret))
        expired = token is not None and token.expires_at is not None and token.expires_at <= now()
        if token is None:
            raise UnknownToken(_NO_SUCH)
        if token.revoked_at or expired or token.account.disabled_at:
            # A night's script goes on with one that has ended: no stranger who tries.
            raise NotSignedIn(_NO_SUCH)
        account = token.account
        identity = Identity(
            account.id,
            account.name,
            account.role,
            scopes=frozenset(token.scopes),
            second_factor=account.totp_confirmed_at is not None,
        )
        stale = token.last_used_at is None or now() - token.last_used_at > _SEEN_EVERY
        token_id = token.id
    if stale:
        with services.database.write() as session:
            if (row := repository.token_of(session, identity.account_id, token_id)) is not None:
                row.last_used_at = now()
    return identity


def account_of(session: Session, identity: Identity) -> Account:
    """The account row of an identity."""
    account = repository.account(session, identity.account_id)
    if account is None:
        raise NotSignedIn("Your account no longer exists.")
    return account
