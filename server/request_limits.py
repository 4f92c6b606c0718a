"""What comes in is bounded before anybody is recognised: bodies, and pages that wait."""

import asyncio
import re
import time
from dataclasses import dataclass
from typing import Literal

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.accounts.access import identify
from server.accounts.workspaces import recognise_uploader
from server.context import services_of
from server.core.errors import ApiError, refusal_response
from server.core.settings import Settings
from server.core.values import body_problem

# What comes in is bounded before anybody is recognized: size, time and text of every request's body.
#
# Written as plain ASGI because Starlette's BaseHTTPMiddleware costs as much as a whole rating.

ANONYMOUS_BYTES = 64 * 1024
"""Largest JSON body of an unknown sender."""
SIGNED_IN_BYTES = 16 * 1024 * 1024
"""Largest JSON body of an account under /api/admin: a definition, or a table of clips."""
HELD_BYTES = 32 * 1024 * 1024
"""For all bodies under way in this process together; the first `ANONYMOUS_BYTES` of each are not counted."""
QUERY_BYTES, MAX_HEADERS = 8 * 1024, 200
"""A query of 60 kB or 3,000 headers took the loop, and with it every rater, for 60 ms."""
BODY_S = 30.0
UPLOAD_IDLE_S, UPLOAD_GRACE_S, UPLOAD_BYTES_PER_S = 30.0, 60.0, 16 * 1024
UPLOADS = "/api/admin/uploads"
_MORE_FILES = re.compile(rf"{UPLOADS}/[0-9a-f]+/files/?")
_NUL = re.compile(rb"%00|\0")
ADMIN, ACCOUNTLESS = "/api/admin/", ("/api/admin/session", "/api/admin/invitations/")
RUN = "/api/run/"
Kind = Literal["anonymous", "run", "admin", "upload"]


class BodyTooLarge(ApiError, status=413, code="too_large"):
    """The body is larger than its sender may send."""


class AddressTooLong(ApiError, status=414, code="address_too_long"):
    """The address asks for more than any page does."""


class TooManyHeaders(ApiError, status=431, code="too_many_headers"):
    """The request has more headers than any program sends."""


class BodyTooSlow(ApiError, status=408, code="too_slow"):
    """The body did not come in time."""


class TextNotStorable(ApiError, status=422, code="invalid_text"):
    """The body holds what no text can hold."""


class Busy(ApiError, status=503, code="busy"):
    """Too much is under way at this moment."""


class _ClientGone(Exception):
    """The client went away before its request was complete."""


def too_large(limit: int) -> BodyTooLarge:
    """The refusal of a body over `limit` bytes."""
    shown = f"{limit >> 20} MiB" if limit >= 1 << 20 else f"{limit >> 10} KiB"
    return BodyTooLarge(f"The request is too large: the maximum is {shown}.")


def kind_of(method: str, path: str) -> Kind:
    """To which class of limits a request belongs."""
    if method == "POST" and (path.rstrip("/") == UPLOADS or _MORE_FILES.fullmatch(path)):
        return "upload"
    if path.startswith(ADMIN) and not path.startswith(ACCOUNTLESS):
        return "admin"
    return "run" if path.startswith(RUN) else "anonymous"


@dataclass
class _Body:
    """What has come of one body, and what may come."""

    limit: int
    content: bytearray
    held: int = 0


class RequestLimits:
    """Collect JSON bodies within their limits, let uploads of known senders stream, cut those who stall."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.run_bytes, self.upload_bytes = settings.max_body_bytes, settings.max_upload_bytes
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        try:
            _check_head(scope)
            if scope["method"] in ("GET", "HEAD"):
                inner = receive
            elif kind_of(scope["method"], scope["path"]) == "upload":
                inner = await self._upload(scope, receive)
            else:
                inner = await self._collected(scope, receive)
        except _ClientGone:
            return
        except ApiError as refusal:
            # The rest of the body is not waited for.
            await refusal_response(refusal, connection="close")(scope, receive, send)
            return
        await self.app(scope, inner, send)

    async def _upload(self, scope: Scope, receive: Receive) -> Receive:
        """Recognise the sender first; then let the body pass, counted and timed."""
        request = Request(scope)
        services = services_of(request)
        await run_in_threadpool(recognise_uploader, request, services.database, services.settings)
        if _declared_length(scope) > self.upload_bytes:
            raise too_large(self.upload_bytes)
        return _count_body(receive, self.upload_bytes)

    async def _collected(self, scope: Scope, receive: Receive) -> Receive:
        kind, declared = kind_of(scope["method"], scope["path"]), _declared_length(scope)
        body = _Body(self.run_bytes if kind == "run" else ANONYMOUS_BYTES, bytearray())
        try:
            async with asyncio.timeout(BODY_S):
                if declared > body.limit:
                    await self._raise_limit(scope, kind, body, declared)
                await self._collect(scope, receive, kind, body)
        except TimeoutError:
            raise BodyTooSlow(f"The request did not arrive within {BODY_S:.0f} s; try again.") from None
        finally:
            self._held -= body.held
        if (problem := body_problem(bytes(body.content))) is not None:
            raise TextNotStorable(f"The request was refused: {problem}.")
        return _replay_body(bytes(body.content), receive)

    async def _collect(self, scope: Scope, receive: Receive, kind: Kind, body: _Body) -> None:
        more = True
        while more:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise _ClientGone
            body.content += message.get("body", b"")
            more = message.get("more_body", False)
            if len(body.content) > body.limit:
                await self._raise_limit(scope, kind, body, len(body.content))
            over = max(0, len(body.content) - ANONYMOUS_BYTES)
            self._held += over - body.held
            body.held = over
            if self._held > HELD_BYTES:
                raise Busy("The server is busy. Please try again in 2 s.", headers={"retry-after": "2"})

    async def _raise_limit(self, scope: Scope, kind: Kind, body: _Body, size: int) -> None:
        """Let an account send more than a stranger; BodyTooLarge where that is not enough or nobody's."""
        if kind == "admin" and body.limit < SIGNED_IN_BYTES:
            request = Request(scope)
            services = services_of(request)
            await run_in_threadpool(identify, request, services.database, services.settings)
            body.limit = SIGNED_IN_BYTES
        if size > body.limit:
            raise too_large(body.limit)


def _check_head(scope: Scope) -> None:
    """Refuse what is slow to read before anything reads it."""
    if len(scope["query_string"]) > QUERY_BYTES:
        raise AddressTooLong(f"The URL is too long: the maximum is {QUERY_BYTES >> 10} KiB after the ?.")
    if "\0" in scope["path"] or _NUL.search(scope["query_string"]):
        raise TextNotStorable(
            "The request was refused: its URL contains a NUL character, which cannot be stored."
        )
    if len(scope["headers"]) > MAX_HEADERS:
        raise TooManyHeaders(f"The request has too many headers: the maximum is {MAX_HEADERS}.")


def _declared_length(scope: Scope) -> int:
    text = dict(scope["headers"]).get(b"content-length", b"0")
    return int(text) if text.isdigit() else 0


def _replay_body(content: bytes, receive: Receive) -> Receive:
    """A `receive` that gives the collected body once, then what the connection says."""
    given = False

    async def replay() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": content, "more_body": False}

    return replay


def _count_body(receive: Receive, limit: int) -> Receive:
    """A `receive` that refuses an upload which grows too large, stalls or trickles."""
    received, began = 0, time.monotonic()

    async def counted() -> Message:
        nonlocal received
        try:
            async with asyncio.timeout(UPLOAD_IDLE_S):
                message = await receive()
        except TimeoutError:
            raise _too_slow() from None
        received += len(message.get("body", b""))
        if received > limit:
            # FastAPI lets only this exception through while it reads a body.
            raise HTTPException(413, too_large(limit).message, {"connection": "close"})
        spent = time.monotonic() - began
        if message.get("more_body") and spent > UPLOAD_GRACE_S and received < spent * UPLOAD_BYTES_PER_S:
            raise _too_slow()
        return message

    return counted


def _too_slow() -> HTTPException:
    return HTTPException(408, "The upload stalled. Please try again.", {"connection": "close"})


# Experimenters' pages wait for one another, and raters for none of them.

AT_ONCE = 8
"""Requests of experimenters that a worker serves at a time; the others wait, the first asked for first.

Every request takes one of the forty threads that serve a worker. Three hundred at once had raters' clips wait
until all of them were done, which took four tenths of a second.
"""


class ConcurrencyLimit:
    """Let few requests of experimenters in at a time, each until its answer begins.

    What streams on after that, as the monitor does, holds nobody up. Signing in is bounded elsewhere and
    uploads take as long as their sender, so neither waits here.
    """

    def __init__(self, app: ASGIApp, at_once: int = AT_ONCE) -> None:
        self.app = app
        self._free = asyncio.Semaphore(at_once)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or kind_of(scope["method"], scope["path"]) != "admin":
            await self.app(scope, receive, send)
            return
        await self._free.acquire()
        inside = True

        async def send_and_leave(message: Message) -> None:
            nonlocal inside
            if inside and message["type"] == "http.response.start":
                inside = False
                self._free.release()
            await send(message)

        try:
            await self.app(scope, receive, send_and_leave)
        finally:
            if inside:
                self._free.release()
