"""What the endpoints of sign-in by providers take and give."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from server.request_body import RequestBody

NextPage = Annotated[
    str, StringConstraints(max_length=300, pattern=r"^/([^/\\\x00-\x20\x7f][^\\\x00-\x20\x7f]*)?$")
]
"""A page of the admin site, from its root on; never an address elsewhere."""


class ProviderOut(BaseModel):
    """A service that one can sign in with."""

    id: str
    label: str


class WaysIn(BaseModel):
    """How one can sign in here, besides by name and password."""

    providers: list[ProviderOut]
    resets_by_mail: bool = Field(description="Whether forgotten passwords are reset by mail.")


class BeginSignIn(RequestBody):
    """Where to go after signing in."""

    next: NextPage = "/"


class BeginLink(RequestBody):
    """Who asks proves that she is the account's own person, not only somebody at her open browser."""

    proof: Annotated[str, StringConstraints(min_length=1, max_length=200)] = Field(
        description="The present password; where the account has none, a code of its second factor."
    )


class Elsewhere(BaseModel):
    """An address of the provider to which the browser goes."""

    url: str


class SecondFactorCode(RequestBody):
    """The code of the authenticator app, or a recovery code."""

    code: Annotated[str, StringConstraints(strip_whitespace=True, min_length=6, max_length=40)]


class LoginOut(BaseModel):
    """A way by which the own account is signed in to."""

    model_config = ConfigDict(from_attributes=True)

    id: int
    provider: str = Field(description="Name of the provider, as declared on this server.")
    issuer: str
    label: str
    created_at: datetime
    last_used_at: datetime | None
