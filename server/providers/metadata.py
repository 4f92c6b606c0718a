"""What a provider says of itself (OpenID Connect Discovery 1.0, 3): the part that is used here."""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from server.providers.declaration import is_safe
from server.providers.refusals import away


def _safe(value: str) -> str:
    if not is_safe(value):
        raise ValueError("not an address by https")
    return value


Address = Annotated[str, AfterValidator(_safe)]


class Metadata(BaseModel):
    """A provider's description, checked; what is not used here is left out."""

    model_config = ConfigDict(frozen=True)

    issuer: str
    authorization_endpoint: Address
    token_endpoint: Address
    jwks_uri: Address
    userinfo_endpoint: Address | None = None
    token_endpoint_auth_methods_supported: tuple[str, ...] | None = None
    id_token_signing_alg_values_supported: tuple[str, ...] | None = None
    claims_parameter_supported: bool | None = None
    authorization_response_iss_parameter_supported: bool | None = None


def metadata_of(issuer: str, told: dict[str, Any]) -> Metadata:
    """Check a provider's description of itself.

    Raises
    ------
    ProviderAway
        It is another issuer's, or not of the form that the standard gives it.
    """
    try:
        metadata = Metadata.model_validate(told)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        raise away(f"its description: {name}: {first['msg']}"[:300]) from error
    if metadata.issuer != issuer:
        raise away(f"it calls itself {metadata.issuer[:200]!r}")
    return metadata
