"""Watches every request: counts it, times it, and logs those that failed or took long."""

import logging
import time

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.operations.metrics import ANSWERS, SECONDS, UNDER_WAY
from server.settings import Settings

log = logging.getLogger("palpebra.requests")
CLIENT_GONE = 499
"""Counted where nobody is left to answer: the client left, or sent what is not HTTP and was cut off."""
METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class Observer:
    """Plain ASGI, outside all else that is ours; it never sees an internet address."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.which, self.slow_s = settings.log_requests, settings.log_slow_ms / 1000

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, seconds, status = time.perf_counter(), None, 500

        async def watched(message: Message) -> None:
            nonlocal seconds, status
            if message["type"] == "http.response.start":
                # Up to the beginning of the answer: a stream may last for an hour and is not slow for that.
                seconds, status = time.perf_counter() - began, message["status"]
            await send(message)

        UNDER_WAY.inc()
        try:
            await self.app(scope, receive, watched)
            if seconds is None:
                status = CLIENT_GONE
        except ClientDisconnect:
            status = CLIENT_GONE
        finally:
            UNDER_WAY.dec()
            self._note(scope, status, time.perf_counter() - began if seconds is None else seconds)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        method = scope["method"] if scope["method"] in METHODS else "other"
        route = route_template(scope)
        ANSWERS.labels(method, route, status).inc()
        SECONDS.labels(route).observe(seconds)
        logged = {"all": True, "none": False}.get(self.which, status >= 500 or seconds > self.slow_s)
        if logged:
            fields = {"method": method, "route": route, "status": status, "ms": round(1000 * seconds, 1)}
            log.log(logging.ERROR if status >= 500 else logging.INFO, "request", extra={"fields": fields})


def route_template(scope: Scope) -> str:
    """The address as declared, such as /api/links/{link_token}: without anybody's token."""
    return str(getattr(scope.get("route"), "path", "unmatched"))
