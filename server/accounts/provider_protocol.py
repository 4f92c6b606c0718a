"""OpenID Connect as a client: authorization code with PKCE, by Authlib; what comes back is believed last."""

import asyncio
import json
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any
from urllib.request import getproxies, proxy_bypass

import httpx2
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from server.core.errors import ApiError
from server.core.settings import Provider, Settings, is_safe

# Authlib and joserfc are imported where they work: few servers have a provider, but every start would wait.
if TYPE_CHECKING:
    from joserfc import jwt
    from joserfc.jwk import KeySet
    from joserfc.jws import JWSRegistry

# How a sign-in by a provider is refused: one sentence for people, the reason in the log.

log = logging.getLogger("palpebra")


class ProviderAway(ApiError, status=503, code="provider_away"):
    """The provider does not answer, or not as one."""


class NotRecognised(ApiError, status=401, code="sign_in_refused"):
    """What the provider's answer says does not hold."""


class LogoutRefused(ApiError, status=400, code="logout_refused"):
    """What came is not a valid logout token (Back-Channel Logout 1.0, 2.8)."""


def provider_away(why: str) -> ProviderAway:
    """A refusal to raise where the provider does not answer as it should."""
    log.warning("a provider of sign-in cannot be used: %s", why)
    return ProviderAway("The sign-in service does not respond correctly. Please try again later.")


def sign_in_refused(why: str) -> NotRecognised:
    """A refusal to raise where what was answered does not hold."""
    log.warning("a sign-in by a provider is refused: %s", why)
    return NotRecognised("The sign-in could not be confirmed. Please start it again.")


def no_logout(why: str) -> LogoutRefused:
    """A refusal to raise where a logout token does not hold."""
    log.warning("a logout token of a provider is refused: %s", why)
    return LogoutRefused("This logout token is not valid; see the server log for the reason.")


# What a provider says of itself (OpenID Connect Discovery 1.0, 3): the part that is used here.


def _safe(value: str) -> str:
    if not is_safe(value):
        raise ValueError("not an https URL")
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
        raise provider_away(f"its description: {name}: {first['msg']}"[:300]) from error
    if metadata.issuer != issuer:
        raise provider_away(f"it calls itself {metadata.issuer[:200]!r}")
    return metadata


# What a provider answers over HTTP: bounded in bytes and in time as a whole, and a JSON object.

WHOLE_S = 10.0
"""How long an answer may take, from the connection to its last byte."""
BYTES_MAX = 1_000_000
"""Descriptions, keys and tokens have some thousands."""
MALFORMED = (httpx2.HTTPError, httpx2.InvalidURL, ValueError, RecursionError)
"""What reading an answer as JSON raises where it is none."""


class BoundedTransport(httpx2.AsyncBaseTransport):
    """Reads a whole answer within its bounds. A timeout of the client's is one of each read alone."""

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        """The answer with its content; HTTPError where a bound is passed."""
        request.headers["accept-encoding"] = "identity"
        try:
            async with asyncio.timeout(WHOLE_S):
                return await self._answer(request)
        except TimeoutError as error:
            raise httpx2.ReadTimeout(f"no whole answer within {WHOLE_S:g} s", request=request) from error

    async def _answer(self, request: httpx2.Request) -> httpx2.Response:
        async with httpx2.AsyncHTTPTransport(proxy=_proxy_to(request.url)) as network:
            answer = await network.handle_async_request(request)
            try:
                content = await _content(answer, request)
            finally:
                await answer.aclose()
        # What was not asked for could grow without bound when it is unpacked.
        if answer.headers.get("content-encoding", "identity") != "identity":
            raise httpx2.DecodingError("the response is compressed, which was not requested", request=request)
        return httpx2.Response(answer.status_code, headers=answer.headers, content=content, request=request)


async def _content(answer: httpx2.Response, request: httpx2.Request) -> bytes:
    content = bytearray()
    async for piece in answer.aiter_raw():
        content += piece
        if len(content) > BYTES_MAX:
            raise httpx2.ReadError(f"the response has more than {BYTES_MAX} bytes", request=request)
    return bytes(content)


def _proxy_to(url: httpx2.URL) -> str | None:
    """The environment's proxy, which a client with its own transport does not look for."""
    if proxy_bypass(url.host):
        return None
    return getproxies().get(url.scheme)


async def json_object(address: str) -> dict[str, Any]:
    """What is at an address of the provider's.

    Raises
    ------
    ProviderAway
        Nothing answers there within the bounds, or no JSON object.
    """
    try:
        async with httpx2.AsyncClient(
            transport=BoundedTransport(), timeout=WHOLE_S, follow_redirects=False
        ) as client:
            answer = await client.get(address, headers={"accept": "application/json"})
        answer.raise_for_status()
        told = answer.json()
    except MALFORMED as error:
        raise provider_away(f"{address}: {type(error).__name__} {error}"[:300]) from error
    if not isinstance(told, dict):
        raise provider_away(f"{address} is not a JSON object")
    return told


# OpenID Connect as a client: authorization code with PKCE, by Authlib; what comes back is believed last.
#
# Source: OpenID Connect Core 1.0 (3.1.2, 3.1.3), RFC 7636 (PKCE), RFC 9207 (issuer in the answer),
# OpenID Connect Back-Channel Logout 1.0 (2.4, 2.6).

KEPT_S = 3600.0
"""How long a provider's description and keys are kept."""
KEYS_AGAIN_S = 60.0
"""An unknown key makes them be fetched again, at most this often."""
LEEWAY_S = 30
"""How far the provider's clock may be off."""
ALGORITHMS = frozenset(
    ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA", "Ed25519")
)
"""Signatures by a key pair. `none`, and those with the client's secret, are never accepted."""
ESSENTIAL = {"essential": True}
LOGOUT_EVENT = "http://schemas.openid.net/event/backchannel-logout"
LOGOUT_TOKEN_S = 300
"""How old a logout token may be."""


@dataclass(frozen=True)
class ProviderIdentity:
    """Whom a provider has signed in: a subject of an issuer, and what is said of it."""

    issuer: str
    subject: str
    claims: Mapping[str, Any]
    second_factor: bool


@dataclass(frozen=True)
class ProviderSignOut:
    """Who signed out at her provider, by a token of this name (`jti`)."""

    issuer: str
    subject: str
    token: str


@dataclass(frozen=True)
class Secrets:
    """What one browser's one sign-in is bound by; none of it is stored."""

    state: str
    nonce: str
    verifier: str


class ProviderClient:
    """One provider, with what it says of itself kept for an hour."""

    def __init__(self, provider: Provider, redirect_uri: str) -> None:
        self.provider, self._redirect_uri = provider, redirect_uri
        self._metadata: Metadata | None = None
        self._keys: dict[str, Any] = {}
        self._metadata_at = self._keys_at = float("-inf")
        self._handled: dict[str, float] = {}

    async def authorization_url(self, secrets: Secrets) -> str:
        """Where the browser goes to sign in."""
        metadata = await self._described()
        async with self._client(metadata) as client:
            url, _ = client.create_authorization_url(
                metadata.authorization_endpoint,
                state=secrets.state,
                nonce=secrets.nonce,
                code_verifier=secrets.verifier,
                **self._asked_of_factors(metadata),
            )
        return str(url)

    def _asked_of_factors(self, metadata: Metadata) -> dict[str, str]:
        """Parameters by which the ID token says how somebody signed in, where that is trusted (Core 5.5)."""
        asked = {}
        if self.provider.second_factor_acr:
            asked["acr_values"] = " ".join(self.provider.second_factor_acr)
        if self.provider.second_factor_amr and metadata.claims_parameter_supported:
            asked["claims"] = json.dumps({"id_token": {"amr": None}})
        return asked

    async def recognise(self, code: str, issuer: str | None, secrets: Secrets) -> ProviderIdentity:
        """Exchange a code and check everything that its ID token says.

        Parameters
        ----------
        issuer : str or None
            As the answer names it (RFC 9207); must be there where the provider says that it always is.
        """
        metadata = await self._described()
        announced = metadata.authorization_response_iss_parameter_supported
        if issuer != self.provider.issuer and (issuer is not None or announced):
            raise sign_in_refused("the response came from another issuer")
        async with self._client(metadata) as client:
            token = await self._token(client, metadata, code, secrets.verifier)
            claims = await self._claims(metadata, token, secrets.nonce)
            more = await self._user_info(client, metadata, claims)
        return ProviderIdentity(
            issuer=self.provider.issuer,
            subject=str(claims["sub"]),
            claims={**more, **claims},
            second_factor=self._has_second_factor(claims),
        )

    async def signed_out(self, logout_token: str) -> ProviderSignOut:
        """Check a logout token, which the provider itself sends.

        One that names a session alone (`sid`) is refused: sessions here are known by their subject.
        """
        from authlib.oauth2.claims import JWTClaims
        from joserfc.errors import JoseError

        metadata = await self._described()
        options = {"iss": {**ESSENTIAL, "value": self.provider.issuer}, "sub": ESSENTIAL, "jti": ESSENTIAL}
        options |= {"aud": {**ESSENTIAL, "value": self.provider.client_id}, "iat": ESSENTIAL}
        try:
            decoded = await self._decoded(metadata, logout_token, _registry(metadata))
            JWTClaims(decoded.claims, decoded.header, options).validate(leeway=LEEWAY_S)
        except (JoseError, ValueError, TypeError) as error:
            raise no_logout(f"it is not valid: {type(error).__name__} {error}") from error
        claims, events = decoded.claims, decoded.claims.get("events")
        if not isinstance(events, dict) or LOGOUT_EVENT not in events or "nonce" in claims:
            raise no_logout("it has no logout event, or it has a nonce")
        if claims["iat"] < time.time() - LOGOUT_TOKEN_S:
            raise no_logout("it is too old")
        return ProviderSignOut(self.provider.issuer, str(claims["sub"]), str(claims["jti"]))

    def has_handled(self, ended: ProviderSignOut) -> bool:
        """Whether this logout token ended sessions before, in this worker."""
        return ended.token in self._handled

    def handled(self, ended: ProviderSignOut) -> None:
        """Remember a logout token for as long as it could come again."""
        moment = time.monotonic()
        kept = {token: until for token, until in self._handled.items() if until > moment}
        self._handled = kept | {ended.token: moment + LOGOUT_TOKEN_S + 2 * LEEWAY_S}

    def _has_second_factor(self, claims: Mapping[str, Any]) -> bool:
        """Whether the ID token says so in a word that the declaration trusts."""
        methods = claims.get("amr") or []
        by_amr = not set(self.provider.second_factor_amr).isdisjoint(m for m in methods if isinstance(m, str))
        return by_amr or claims.get("acr") in self.provider.second_factor_acr

    def _client(self, metadata: Metadata) -> Any:
        from authlib.integrations.httpx_client import AsyncOAuth2Client

        secret = self.provider.client_secret()
        methods = metadata.token_endpoint_auth_methods_supported or ("client_secret_basic",)
        by_post = "client_secret_basic" not in methods and "client_secret_post" in methods
        method = "client_secret_post" if by_post else "client_secret_basic"
        return AsyncOAuth2Client(
            client_id=self.provider.client_id,
            client_secret=secret,
            token_endpoint_auth_method=method if secret else "none",
            scope=self.provider.scopes,
            redirect_uri=self._redirect_uri,
            code_challenge_method="S256",
            timeout=WHOLE_S,
            transport=BoundedTransport(),
            follow_redirects=False,
        )

    async def _described(self) -> Metadata:
        if self._metadata is None or time.monotonic() - self._metadata_at > KEPT_S:
            address = f"{self.provider.issuer.rstrip('/')}/.well-known/openid-configuration"
            self._metadata = metadata_of(self.provider.issuer, await json_object(address))
            self._metadata_at = time.monotonic()
        return self._metadata

    async def _token(self, client: Any, metadata: Metadata, code: str, verifier: str) -> Mapping[str, Any]:
        from authlib.common.errors import AuthlibBaseError

        try:
            token = await client.fetch_token(metadata.token_endpoint, code=code, code_verifier=verifier)
        except AuthlibBaseError as error:
            raise sign_in_refused(f"the code was not accepted ({str(error.error)[:60]!r})") from error
        except MALFORMED as error:
            raise provider_away(f"token endpoint: {type(error).__name__}") from error
        if not isinstance(token.get("id_token"), str):
            raise sign_in_refused("there is no ID token")
        return dict(token)

    async def _claims(self, metadata: Metadata, token: Mapping[str, Any], nonce: str) -> Mapping[str, Any]:
        """What a checked ID token says: signature, issuer, audience, times, nonce (Core 1.0, 3.1.3.7)."""
        from authlib.oidc.core import CodeIDToken
        from joserfc.errors import JoseError

        own = self.provider.client_id
        options = {
            "iss": {**ESSENTIAL, "value": self.provider.issuer},
            "aud": {**ESSENTIAL, "value": own},
            "sub": ESSENTIAL,
            "exp": ESSENTIAL,
            "iat": ESSENTIAL,
        }
        params = {"nonce": nonce, "client_id": own, "access_token": token.get("access_token")}
        try:
            decoded = await self._decoded(metadata, token["id_token"], _registry(metadata))
            claims = CodeIDToken(decoded.claims, decoded.header, options, params)
            claims.validate(leeway=LEEWAY_S)
        except (JoseError, ValueError, TypeError) as error:
            raise sign_in_refused(f"its ID token is not valid: {type(error).__name__} {error}") from error
        if not isinstance(claims["sub"], str) or not 1 <= len(claims["sub"]) <= 255:
            raise sign_in_refused("its ID token names no subject")
        return dict(claims)

    async def _decoded(self, metadata: Metadata, text: str, registry: "JWSRegistry") -> "jwt.Token":
        from joserfc import jwt
        from joserfc.errors import InvalidKeyIdError

        keys = await self._key_set(metadata, KEPT_S)
        try:
            return jwt.decode(text, keys, registry=registry)
        except InvalidKeyIdError:
            return jwt.decode(text, await self._key_set(metadata, KEYS_AGAIN_S), registry=registry)

    async def _key_set(self, metadata: Metadata, age: float) -> "KeySet":
        from joserfc.jwk import KeySet

        if time.monotonic() - self._keys_at > age:
            self._keys = await json_object(metadata.jwks_uri)
            self._keys_at = time.monotonic()
        public = [
            key
            for key in self._keys.get("keys", [])
            if isinstance(key, dict) and key.get("kty") in ("RSA", "EC", "OKP") and key.get("use") != "enc"
        ]
        return KeySet.import_key_set({"keys": public})

    async def _user_info(
        self, client: Any, metadata: Metadata, claims: Mapping[str, Any]
    ) -> Mapping[str, Any]:
        """Claims that the ID token leaves out, asked for only where a rule or a name needs them."""
        from authlib.common.errors import AuthlibBaseError

        needed = {rule.claim.split(".")[0] for rule in self.provider.roles if rule.claim}
        endpoint = metadata.userinfo_endpoint
        if (needed | {"name"}) <= claims.keys() or endpoint is None:
            return {}
        try:
            answer = await client.get(endpoint)
            answer.raise_for_status()
            told = answer.json()
        except (AuthlibBaseError, *MALFORMED) as error:
            raise provider_away(f"userinfo: {type(error).__name__}") from error
        if not isinstance(told, dict) or told.get("sub") != claims["sub"]:
            raise sign_in_refused("its user info is about another person")
        return told


def _registry(metadata: Metadata) -> "JWSRegistry":
    from joserfc.jws import JWSRegistry

    announced = metadata.id_token_signing_alg_values_supported or ("RS256",)
    return JWSRegistry(algorithms=sorted(ALGORITHMS.intersection(announced)))


# The clients of the declared providers: one each, for what they keep of them.


class Providers:
    """One client per declared provider; the browser returns to a separate address for each."""

    def __init__(self, settings: Settings) -> None:
        self._clients = {
            name: ProviderClient(
                provider, f"{settings.public_url}/api/admin/session/providers/{name}/callback"
            )
            for name, provider in settings.oidc.items()
        }

    def of(self, provider_id: str) -> ProviderClient:
        """The client of a declared provider."""
        return self._clients[provider_id]
