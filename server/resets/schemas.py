"""What the endpoints of reset by mail take and give."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, StringConstraints

from server.accounts.schemas import Password
from server.request_body import RequestBody

_ATOM = r"[A-Za-z0-9!#$%&'*+/=?^_`{|}~-]+"
_LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?"


def _is_an_addr_spec(address: str) -> str:
    if len(address.rpartition("@")[0]) > 64:
        raise ValueError("expected at most 64 characters before the @")
    if "=?" in address:
        raise ValueError("expected no '=?', with which encoded words of a letter's head begin")
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
