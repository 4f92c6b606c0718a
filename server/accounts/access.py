"""Who is asking, a browser or an API token, and what each may do: dependencies of endpoints."""

import re
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.security import APIKeyCookie, HTTPBearer
from sqlalchemy.orm import Session

from server.accounts import repository
from server.accounts.identity import (
    Identity,
    NotAllowed,
    NotSignedIn,
    Scope,
    SecondFactorNeeded,
    UnknownToken,
    must_be_fresh,
)
from server.core.db import Database
from server.core.requests import DatabaseDep, SettingsDep
from server.core.row_security import act_for
from server.core.settings import Settings
from server.core.values import hash_token, now
from server.models import ROLES, Account, AdminSession, Role

# Who is asking: a signed-in browser or an API token.

COOKIE = "palpebra_session"
_SEEN_EVERY = timedelta(minutes=1)
_BY_ITSELF = re.compile(r"/editors/[^/]+$")
"""What an open page asks by itself: no sign that somebody is there."""
_NO_SUCH = "This API token is unknown, revoked or expired. Create a new one."


def check_origin(request: Request, settings: Settings) -> None:
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
                "This change was refused: the request has neither an Origin nor a Sec-Fetch-Site header. "
                "Programs must use an API token instead of the cookie."
            )
        raise NotAllowed("This change was requested by another site and was refused.")
    own = {settings.public_url, f"{request.url.scheme}://{request.headers.get('host', '')}"}
    if _address_of(origin) not in own:
        raise NotAllowed(f"This change was requested by another site ({origin[:100]}) and was refused.")


def _address_of(origin: str) -> str:
    """Scheme and host of an origin; empty if it is not an address."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return ""
    return f"{parts.scheme}://{parts.netloc}"


def identify(request: Request, database: Database, settings: Settings) -> Identity:
    """The identity of a request, which acts for it from here on; NotSignedIn where there is none."""
    identity = _recognized_identity(request, database, settings)
    needed = settings.owners_second_factor and identity.role == "owner"
    if needed and not identity.second_factor:
        identity = replace(identity, role="experimenter", held_back=True)
    act_for(identity.account_id)
    request.state.identity = identity
    return identity


def _recognized_identity(request: Request, database: Database, settings: Settings) -> Identity:
    authorization = request.headers.get("authorization", "")
    if authorization.startswith("Bearer "):
        return _by_token(database, authorization.removeprefix("Bearer ").strip())
    cookie = request.cookies.get(COOKIE)
    if not cookie:
        raise NotSignedIn("Please sign in.")
    check_origin(request, settings)
    return _by_cookie(
        database, settings.session_idle, cookie, is_used=not _BY_ITSELF.search(request.url.path)
    )


def _by_cookie(database: Database, session_idle: timedelta, cookie: str, *, is_used: bool) -> Identity:
    with database.read() as session:
        signed_in = repository.session_by_token(session, hash_token(cookie))
        since = now() - session_idle
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
        stale = is_used and now() - signed_in.last_seen_at > _SEEN_EVERY
    if stale:
        with database.write() as session:
            if (row := repository.session_of(session, identity.account_id, identity.session_id)) is not None:
                row.last_seen_at = now()
    return identity


def _has_ended(signed_in: AdminSession, idle_since: datetime) -> bool:
    """Whether a session was ended, is too old, or was not used since."""
    return bool(signed_in.revoked_at or signed_in.expires_at <= now() or signed_in.last_seen_at <= idle_since)


def _by_token(database: Database, secret: str) -> Identity:
    with database.read() as session:
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
        with database.write() as session:
            if (row := repository.token_of(session, identity.account_id, token_id)) is not None:
                row.last_used_at = now()
    return identity


def account_of(session: Session, identity: Identity) -> Account:
    """The account row of an identity."""
    account = repository.account(session, identity.account_id)
    if account is None:
        raise NotSignedIn("Your account no longer exists.")
    return account


# What each may do: dependencies of endpoints, by role on the server, scope of a token and age of sign-in.

_cookie_scheme = APIKeyCookie(name=COOKIE, auto_error=False, description="A signed-in browser.")
_bearer_scheme = HTTPBearer(auto_error=False, description="An API token with scopes.")


class _Access:
    """A dependency: lets in accounts of at least `role` on the server; tokens with one of `scopes` too.

    Parameters
    ----------
    fresh : bool, optional
        Of browsers those alone that signed in within `FRESH_FOR`.
    """

    def __init__(self, role: Role, *scopes: Scope, fresh: bool = False) -> None:
        self.role, self.scopes, self.fresh = role, scopes, fresh

    def __call__(
        self,
        request: Request,
        database: DatabaseDep,
        settings: SettingsDep,
        _cookie: Annotated[str | None, Depends(_cookie_scheme)],
        _bearer: Annotated[object, Depends(_bearer_scheme)],
    ) -> Identity:
        identity = identify(request, database, settings)
        if identity.held_back and self.role == "owner":
            raise SecondFactorNeeded(
                "Owners need a second factor on this server. Set one up under My account, or sign in again "
                "with it."
            )
        if ROLES.index(identity.role) < ROLES.index(self.role):
            raise NotAllowed(f"This requires the role {self.role} on this server; yours is {identity.role}.")
        if identity.scopes is not None:
            if not self.scopes:
                raise NotAllowed("This cannot be done with an API token. Sign in with a browser.")
            if identity.scopes.isdisjoint(self.scopes):
                scopes = " or ".join(f"'{scope}'" for scope in self.scopes)
                raise NotAllowed(f"This requires a token with the scope {scopes}.")
        if self.fresh and identity.scopes is None:
            must_be_fresh(identity)
        return identity


# Who is signed in, by what a token must carry. The study's query decides what they may do with a study.
Viewer = Annotated[Identity, Depends(_Access("viewer", "read"))]
"""May look."""
Exporter = Annotated[Identity, Depends(_Access("viewer", "export"))]
"""May download data."""
PersonalReader = Annotated[Identity, Depends(_Access("viewer", "personal"))]
"""May look at single persons: their answers, recruiters' IDs and devices. Scope `read` alone does not do."""
ReportReader = Annotated[Identity, Depends(_Access("viewer", "export", "personal"))]
"""May open the files of reports, which hold rows of single persons."""
WRITER = _Access("viewer", "write")
Writer = Annotated[Identity, Depends(WRITER)]
"""May change things."""
Eraser = Annotated[Identity, Depends(_Access("viewer", "write", fresh=True))]
"""May do what cannot be undone: a browser that signed in a short while ago, or a token that may change."""
Myself = Annotated[Identity, Depends(_Access("viewer"))]
"""A signed-in browser: one's own account, and what no token opens."""
FreshMyself = Annotated[Identity, Depends(_Access("viewer", fresh=True))]
"""A browser that signed in a short while ago: for ways in that would outlive a stolen session."""
Founder = Annotated[Identity, Depends(_Access("experimenter"))]
"""A signed-in browser of one who may make workspaces."""
Owner = Annotated[Identity, Depends(_Access("owner"))]
"""A signed-in browser of one who manages this server: accounts, workspaces, the audit log."""

FreshOwner = Annotated[Identity, Depends(_Access("owner", fresh=True))]
"""An owner who signed in a short while ago: for accounts and invitations, which outlive sessions too."""
