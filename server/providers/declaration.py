"""What is declared of a provider of sign-in (OpenID Connect) in the environment."""

import os
from pathlib import Path
from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, field_validator, model_validator

from server.models.accounts import Role

ProviderId = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,29}$")]
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")


class _Declared(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class RoleRule(_Declared):
    """Who belongs to a workspace by what the provider says of her.

    Without a claim it holds for everybody whom the provider signs in.
    """

    workspace: Annotated[str, StringConstraints(min_length=1, max_length=60)] = Field(
        description="Name of the workspace."
    )
    role: Role = Field(description="What she is in it: viewer, experimenter or owner.")
    claim: str = Field(default="", description="Name of the claim; dots lead into nested ones.")
    value: str = Field(default="", description="What the claim must be, or hold where it is a list.")

    @model_validator(mode="after")
    def _claim_with_value(self) -> Self:
        if bool(self.value) != bool(self.claim):
            raise ValueError("expected claim and value together, or neither of them")
        return self


class Provider(_Declared):
    """A service that signs people in; declared as PALPEBRA_OIDC__NAME__KEY."""

    label: Annotated[str, StringConstraints(min_length=1, max_length=60)] = Field(
        description="What the button says after 'Sign in with'."
    )
    issuer: str = Field(description="Address of the provider, exactly as its tokens write it.")
    client_id: Annotated[str, StringConstraints(min_length=1)] = Field(
        description="What the provider calls this server."
    )
    client_secret_file: Path | None = Field(
        default=None, description="File with the secret; none for a public client."
    )
    scopes: str = Field(default="openid profile", description="What is asked for, `openid` among it.")
    roles: tuple[RoleRule, ...] = Field(
        default=(), description="Who belongs where; without a rule that fits only linked accounts sign in."
    )
    second_factor_amr: tuple[str, ...] = Field(
        default=(), description="Values of `amr` that count as a second factor here; none where empty."
    )
    second_factor_acr: tuple[str, ...] = Field(
        default=(), description="Values of `acr` that count as a second factor here; none where empty."
    )

    @field_validator("issuer")
    @classmethod
    def _is_safe(cls, value: str) -> str:
        if not is_safe(value) or urlsplit(value).query or urlsplit(value).fragment:
            raise ValueError("expected https://... without a query (http only on this machine itself)")
        return value

    @field_validator("scopes")
    @classmethod
    def _asks_for_openid(cls, value: str) -> str:
        if "openid" not in value.split():
            raise ValueError("expected 'openid' among the scopes")
        return value

    @field_validator("client_secret_file")
    @classmethod
    def _is_readable(cls, value: Path | None) -> Path | None:
        if value is not None and not (value.is_file() and os.access(value, os.R_OK)):
            raise ValueError(f"expected a readable file, got {value}")
        return value

    def client_secret(self) -> str | None:
        """The secret as the file holds it now, so that it can be exchanged while the server runs."""
        if self.client_secret_file is None:
            return None
        return self.client_secret_file.read_text(encoding="utf-8").strip()


def is_safe(address: str) -> bool:
    """True for https, and for http that does not leave this machine."""
    parts = urlsplit(address)
    return bool(parts.hostname) and (
        parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in LOCAL_HOSTS)
    )
