"""What every request passes through: security headers, and for whom it acts.

Written as plain ASGI because Starlette's BaseHTTPMiddleware costs as much as a whole rating.
"""

import secrets
from collections.abc import Mapping

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.row_security_repository import acting
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


class RowSecurity:
    """Each request acts for nobody until an account is recognised (`server.row_security_repository`)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        with acting():
            await self.app(scope, receive, send)
