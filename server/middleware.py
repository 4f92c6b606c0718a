"""What every answer passes through: security headers, and a limit on the size of request bodies.

Written as plain ASGI because Starlette's BaseHTTPMiddleware costs as much as a whole rating.
"""

import secrets
from collections.abc import Mapping

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.errors import error_response
from server.settings import Settings

NONCE_PLACEHOLDER = "__CSP_NONCE__"
"""Where a page makes style elements by script, its index.html carries this; each answer replaces it."""


def content_security_policy(nonce: str | None = None, clips_from: str | None = None) -> str:
    """The policy: this server's own files, and clips from their store; inline style only with the nonce."""
    clips = f" {clips_from}" if clips_from else ""
    style = f"style-src 'self' 'nonce-{nonce}'" if nonce else "style-src 'self'"
    return (
        f"default-src 'none'; script-src 'self'; {style}; img-src 'self' blob: data:; "
        f"media-src 'self' blob:{clips}; connect-src 'self'{clips}; worker-src 'self'; font-src 'self'; "
        "manifest-src 'self'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
    )


def new_nonce() -> str:
    """A fresh nonce for one page."""
    return secrets.token_urlsafe(16)


def security_headers(settings: Settings, clips_from: str | None = None) -> Mapping[str, str]:
    """Headers of every answer. Cross-origin isolation also gives the page its finest clock."""
    headers = {
        "content-security-policy": content_security_policy(clips_from=clips_from),
        "x-content-type-options": "nosniff",
        "referrer-policy": "no-referrer",
        "x-frame-options": "DENY",
        "cross-origin-opener-policy": "same-origin",
        "cross-origin-embedder-policy": "require-corp",
        "cross-origin-resource-policy": "same-origin",
        "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), fullscreen=(self)",
    }
    if settings.is_https:
        headers["strict-transport-security"] = "max-age=31536000; includeSubDomains"
    return headers


class SecurityHeaders:
    """Add the security headers to every answer; `no-store` where the answer says nothing of caching."""

    def __init__(self, app: ASGIApp, settings: Settings, clips_from: str | None = None) -> None:
        self.app = app
        self.headers = {**security_headers(settings, clips_from), "cache-control": "no-store"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self.headers.items():
                    headers.setdefault(name, value)
            await send(message)

        await self.app(scope, receive, send_with_headers)


class BodyLimit:
    """Refuse bodies over the limit: small for participants, large under /api/admin for uploads."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.limit, self.upload_limit = settings.max_body_bytes, settings.max_upload_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http" or scope["method"] in ("GET", "HEAD"):
            await self.app(scope, receive, send)
            return
        limit = self.upload_limit if scope["path"].startswith("/api/admin/") else self.limit
        declared = dict(scope["headers"]).get(b"content-length", b"0")
        if declared.isdigit() and int(declared) > limit:
            await error_response(413, "too_large", _too_large(limit))(scope, receive, send)
            return
        received = 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit:
                # Of what reading a body may raise, FastAPI lets only this exception through.
                raise HTTPException(413, _too_large(limit))
            return message

        await self.app(scope, counted, send)


def _too_large(limit: int) -> str:
    shown = f"{limit >> 20} MiB" if limit >= 1 << 20 else f"{limit >> 10} KiB"
    return f"The request is too large: at most {shown} are accepted."
