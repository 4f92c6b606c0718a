"""What the account endpoints take and give."""

import re
from datetime import datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from server.accounts.permission import Scope
from server.models import Role
from server.request_body import RequestBody
from server.text import VisibleObject

NAME = re.compile(r"[\w.@+ -]{2,100}")


def _is_a_name(text: str) -> str:
    if not NAME.fullmatch(text):
        raise ValueError("expected 2 to 100 letters, digits, spaces or any of . @ + - _")
    return text


AccountName = Annotated[str, StringConstraints(strip_whitespace=True), AfterValidator(_is_a_name)]
TOKEN_DAYS_MAX = 366
Password = Annotated[str, StringConstraints(min_length=1, max_length=200)]


class SignIn(RequestBody):
    """Name and password, and where a second factor is set up its code or a recovery code."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, max_length=100)]
    password: Password
    code: Annotated[str, StringConstraints(strip_whitespace=True, max_length=40)] | None = None


class NewAccount(RequestBody):
    """The account an invited person makes."""

    name: AccountName
    password: Password


class ChangePassword(RequestBody):
    """The present password and a new one."""

    password: Password
    new_password: Password


class ConfirmCode(RequestBody):
    """A code from the authenticator app."""

    code: Annotated[str, StringConstraints(strip_whitespace=True, pattern=r"^\d{6}$")]


class ConfirmPassword(RequestBody):
    """The present password, asked for again before something is weakened; a code where there is none."""

    password: Password


class NewInvitation(RequestBody):
    """Whom to invite, as what on the server, and where the account will belong as what.

    Without a workspace it is the default one, and without a role in it the role on the server.
    """

    role: Role
    workspace: Annotated[str, StringConstraints(max_length=60)] | None = None
    workspace_role: Role | None = None
    label: Annotated[str, StringConstraints(strip_whitespace=True, max_length=200)] = ""


class NewToken(RequestBody):
    """An API token: its name, what it may do, and for how many days."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=100)]
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=4)]
    days: Annotated[int, Field(ge=1, le=3650)] | None = 365

    @property
    def days_granted(self) -> int:
        """Days after which it ends; the answer says when.

        Null was a token without an end: older clients that send it, or more days than any token has today,
        get one that ends as late as any may.
        """
        return min(self.days or TOKEN_DAYS_MAX, TOKEN_DAYS_MAX)


class ChangeAccount(RequestBody):
    """What an owner may change of an account."""

    role: Role | None = None
    disabled: bool | None = None


class _Out(BaseModel):
    model_config = ConfigDict(from_attributes=True)


class AccountOut(_Out):
    """An account as others see it."""

    id: int
    name: str
    role: Role
    second_factor: bool
    disabled: bool
    created_at: datetime


class MyWorkspace(BaseModel):
    """A workspace one belongs to, and as what."""

    name: str
    title: str
    role: Role
    second_factor_needed: bool = Field(
        description="Its studies stay closed until the account signs in with a second factor."
    )


class Me(BaseModel):
    """Who is signed in here; `account` is null where nobody is."""

    account: AccountOut | None
    workspaces: list[MyWorkspace] = Field(default=[], description="Where the account belongs.")
    accounts_exist: bool = Field(description="False until the first owner has used the one-time link.")


class SessionOut(_Out):
    """A signed-in browser."""

    id: int
    current: bool
    user_agent: str
    created_at: datetime
    last_seen_at: datetime
    expires_at: datetime


class SecondFactorSetup(BaseModel):
    """What an authenticator app needs."""

    secret: str
    uri: str
    qr_svg: str


class RecoveryCodes(BaseModel):
    """Codes shown once; each signs in once without the app."""

    codes: list[str]


class TokenOut(_Out):
    """An API token without its secret."""

    id: int
    name: str
    scopes: list[Scope]
    created_at: datetime
    last_used_at: datetime | None
    expires_at: datetime | None


class NewTokenOut(TokenOut):
    """A fresh API token; `token` is shown this once."""

    token: str


class InvitationOut(_Out):
    """An invitation that has not been used."""

    id: int
    role: Role
    label: str
    created_at: datetime
    expires_at: datetime


class NewInvitationOut(InvitationOut):
    """A fresh invitation; `url` is shown this once."""

    url: str


class InvitationState(BaseModel):
    """What an invited person sees."""

    role: Role
    status: Literal["open", "used", "expired"]


class AuditOut(_Out):
    """One line of the audit log."""

    id: int
    at: datetime
    actor: str
    action: str
    target_kind: str
    target: str
    details: VisibleObject
