"""What the endpoints of accounts, providers, resets and workspaces take and give."""

import re
from datetime import datetime
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from server.accounts.identity import Scope
from server.core.values import RequestBody, VisibleObject
from server.models import Right, Role

# What the account endpoints take and give.

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


# What the endpoints of reset by mail take and give.

_ATOM = r"[A-Za-z0-9!#$%&'*+/=?^_`{|}~-]+"
_LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?"


def _is_an_addr_spec(address: str) -> str:
    if len(address.rpartition("@")[0]) > 64:
        raise ValueError("expected at most 64 characters before the @")
    if "=?" in address:
        raise ValueError("expected no '=?', which marks encoded words in email headers")
    return address


Address = Annotated[
    str,
    StringConstraints(
        strip_whitespace=True, max_length=200, pattern=rf"^{_ATOM}(\.{_ATOM})*@{_LABEL}(\.{_LABEL})+$"
    ),
    AfterValidator(_is_an_addr_spec),
]
"""Dot-atoms (RFC 5322, 3.4.1): no quotes, comments, routes or literals, which parsers of mail read each their
own way; names of hosts beyond ASCII in their `xn--` form."""
OneTimeToken = Annotated[str, StringConstraints(min_length=1, max_length=100)]


class ForgottenPassword(RequestBody):
    """Whose password is forgotten: the name to sign in with, or the address of mail."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]


class NewPassword(RequestBody):
    """The link's token and the password to be."""

    token: OneTimeToken
    password: Password


class NewAddress(RequestBody):
    """An address of mail for the own account, with the present password."""

    address: Address
    password: Password


class ConfirmAddress(RequestBody):
    """The link's token."""

    token: OneTimeToken


class OwnAddress(BaseModel):
    """Where a link for a new password goes; null where no address is confirmed."""

    address: str | None


# What the endpoints of sign-in by providers take and give.

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
    resets_by_mail: bool = Field(description="Whether forgotten passwords can be reset by email.")


class BeginSignIn(RequestBody):
    """Where to go after signing in."""

    next: NextPage = "/"


class BeginLink(RequestBody):
    """The sender proves to be the account's owner, not only somebody at the owner's open browser."""

    proof: Annotated[str, StringConstraints(min_length=1, max_length=200)] = Field(
        description="The current password; for accounts without a password, a code of the second factor."
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


# What the endpoints of workspaces and grants take and give.

WorkspaceName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,59}$")]
Title = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=200)]


class NewWorkspace(RequestBody):
    """A workspace: its name in addresses, and the title people read."""

    name: WorkspaceName
    title: Title


class ChangeWorkspace(RequestBody):
    """What an owner may change of a workspace."""

    title: Title
    second_factor_required: bool


class WorkspaceOut(BaseModel):
    """A workspace, and the role of the account that asks; null if it is not a member."""

    name: str
    title: str
    second_factor_required: bool
    role: Role | None
    members: int
    studies: int


class MemberOut(BaseModel):
    """Somebody who belongs to a workspace."""

    account: str
    role: Role
    second_factor: bool
    disabled: bool


class SetMember(RequestBody):
    """The role somebody shall have in a workspace."""

    role: Role


class GrantOut(BaseModel):
    """Rights on a study granted to an account in addition to those of its role in the workspace."""

    account: str
    rights: list[Right]


class SetGrant(RequestBody):
    """The rights an account gets on a study in addition to those of its role.

    An empty list takes them back.
    """

    rights: Annotated[list[Right], Field(max_length=5)]


class MoveStudy(RequestBody):
    """Where a study shall belong."""

    workspace: Annotated[str, StringConstraints(max_length=60)]
