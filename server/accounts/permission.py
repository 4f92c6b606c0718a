"""What each may do: dependencies of endpoints, by role on the server, scope of a token and age of sign-in."""

from datetime import timedelta
from typing import Annotated, Literal

from fastapi import Depends, Request
from fastapi.security import APIKeyCookie, HTTPBearer

from server.accounts.identity import COOKIE, Identity, NotAllowed, identify
from server.clock import now
from server.context import ServicesDep
from server.errors import ApiError
from server.models import ROLES, Role

Scope = Literal["read", "personal", "write", "export"]
FRESH_FOR = timedelta(minutes=15)
"""After signing in, what would outlive a stolen session may be changed for so long."""
_cookie_scheme = APIKeyCookie(name=COOKIE, auto_error=False, description="A signed-in browser.")
_bearer_scheme = HTTPBearer(auto_error=False, description="An API token with scopes.")


class SecondFactorNeeded(ApiError):
    """What is asked for opens only to who signed in with a second factor."""

    status = 403
    code = "second_factor_needed"
    audited = True


class SignInAgain(ApiError):
    """What is asked for would outlive a stolen session, and this one began a while ago."""

    status = 403
    code = "sign_in_again"


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
        services: ServicesDep,
        _cookie: Annotated[str | None, Depends(_cookie_scheme)],
        _bearer: Annotated[object, Depends(_bearer_scheme)],
    ) -> Identity:
        identity = identify(request, services)
        if identity.held_back and self.role == "owner":
            raise SecondFactorNeeded(
                "On this server owners need a second factor: set one up under My account, or sign in again "
                "with it."
            )
        if ROLES.index(identity.role) < ROLES.index(self.role):
            raise NotAllowed(f"This needs the role {self.role} on this server; yours is {identity.role}.")
        if identity.scopes is not None:
            if not self.scopes:
                raise NotAllowed("This cannot be done with an API token; sign in in a browser.")
            if identity.scopes.isdisjoint(self.scopes):
                scopes = " or ".join(f"'{scope}'" for scope in self.scopes)
                raise NotAllowed(f"This needs a token with the scope {scopes}.")
        if self.fresh and identity.scopes is None:
            must_be_fresh(identity)
        return identity


def must_be_fresh(identity: Identity) -> None:
    """SignInAgain where the browser's session began longer ago than `FRESH_FOR`."""
    if identity.signed_in_at is None or now() - identity.signed_in_at > FRESH_FOR:
        minutes = FRESH_FOR // timedelta(minutes=1)
        raise SignInAgain(f"For this, please sign in again: you did so more than {minutes} minutes ago.")


# Whoever is signed in, by what a token must carry. What she may do with a study the study's query decides.
Viewer = Annotated[Identity, Depends(_Access("viewer", "read"))]
"""May look."""
Exporter = Annotated[Identity, Depends(_Access("viewer", "export"))]
"""May download data."""
PersonalReader = Annotated[Identity, Depends(_Access("viewer", "personal"))]
"""May look at single persons: their answers, recruiters' ids and devices. Scope `read` alone does not do."""
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
