"""Experimenters' pages wait for one another, and raters for none of them."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.door import kind_of

AT_ONCE = 8
"""Requests of experimenters that a worker serves at a time; the others wait, the first asked for first.

Every request takes one of the forty threads that serve a worker. Three hundred at once had raters' clips wait
until all of them were done, which took four tenths of a second.
"""


class ExperimentersLane:
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
