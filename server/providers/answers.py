"""What a provider answers over HTTP: bounded in bytes and in time as a whole, and a JSON object."""

import asyncio
from typing import Any
from urllib.request import getproxies, proxy_bypass

import httpx2

from server.providers.refusals import away

WHOLE_S = 10.0
"""How long an answer may take, from the connection to its last byte."""
BYTES_MAX = 1_000_000
"""Descriptions, keys and tokens have some thousands."""
MALFORMED = (httpx2.HTTPError, httpx2.InvalidURL, ValueError, RecursionError)
"""What reading an answer as JSON raises where it is none."""


class Bounded(httpx2.AsyncBaseTransport):
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
            raise httpx2.DecodingError("the answer is compressed, which was not asked for", request=request)
        return httpx2.Response(answer.status_code, headers=answer.headers, content=content, request=request)


async def _content(answer: httpx2.Response, request: httpx2.Request) -> bytes:
    content = bytearray()
    async for piece in answer.aiter_raw():
        content += piece
        if len(content) > BYTES_MAX:
            raise httpx2.ReadError(f"the answer has more than {BYTES_MAX} bytes", request=request)
    return bytes(content)


def _proxy_to(url: httpx2.URL) -> str | None:
    """The environment's proxy, which a client with a transport of its own does not look for."""
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
        async with httpx2.AsyncClient(transport=Bounded(), timeout=WHOLE_S, follow_redirects=False) as client:
            answer = await client.get(address, headers={"accept": "application/json"})
        answer.raise_for_status()
        told = answer.json()
    except MALFORMED as error:
        raise away(f"{address}: {type(error).__name__} {error}"[:300]) from error
    if not isinstance(told, dict):
        raise away(f"{address} is not a JSON object")
    return told
