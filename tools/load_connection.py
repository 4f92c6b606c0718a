"""A small HTTP client for `make load`: it shares the cores with the server, so that it must cost little."""

from __future__ import annotations

import asyncio
import json
from typing import Any

ANSWER_S = 60.0
"""As long as a page waits before it sends again."""
_END = b"\r\n\r\n"
_LENGTH = b"content-length:"
_LAST_CHUNK = b"0\r\n\r\n"


class _Answer(asyncio.Protocol):
    """Reads one answer at a time; what a clip holds is counted and let go."""

    def __init__(self) -> None:
        self.waiting: asyncio.Future[tuple[int, bytes]] | None = None
        self.transport: Any = None
        self._expect(keep=True)

    def _expect(self, *, keep: bool) -> None:
        self._keep, self._head, self._body = keep, bytearray(), bytearray()
        self._status, self._left = 0, -1
        self._chunked, self._last = False, b""

    def ask(self, request: bytes, *, keep: bool) -> asyncio.Future[tuple[int, bytes]]:
        """Send a request; the future gets status and content."""
        self._expect(keep=keep)
        self.waiting = asyncio.get_running_loop().create_future()
        self.transport.write(request)
        return self.waiting

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        if self._left < 0:
            self._head += data
            end = self._head.find(_END)
            if end < 0:
                return
            head, data = bytes(self._head[:end]).lower(), bytes(self._head[end + len(_END) :])
            self._status = int(head.split(b" ", 2)[1])
            at = head.find(_LENGTH)
            self._left = int(head[at + len(_LENGTH) :].split(b"\r\n", 1)[0]) if at >= 0 else 0
            self._chunked = b"transfer-encoding: chunked" in head
        if self._chunked:
            self._last = (self._last + data)[-len(_LAST_CHUNK) :]
            self._left = int(self._last != _LAST_CHUNK)
        else:
            self._left -= len(data)
        if self._keep:
            self._body += data
        if self._left <= 0 and self.waiting is not None and not self.waiting.done():
            self.waiting.set_result((self._status, bytes(self._body)))

    def connection_lost(self, exc: Exception | None) -> None:
        self.transport = None
        if self.waiting is not None and not self.waiting.done():
            self.waiting.set_exception(exc or ConnectionResetError("the server closed the connection"))


class Connection:
    """One kept-alive connection; opened again after a failure."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.token = ""
        self._protocol: _Answer | None = None

    async def call(self, method: str, path: str, body: Any = None, *, keep: bool = True) -> tuple[int, bytes]:
        """Status and content (empty where not kept); OSError where the connection broke.

        Parameters
        ----------
        body : Any, optional
            Bytes are sent as a form, all else as JSON.
        """
        try:
            protocol = self._protocol
            if protocol is None or protocol.transport is None:
                loop = asyncio.get_running_loop()
                _, protocol = await loop.create_connection(_Answer, "127.0.0.1", self.port)
                self._protocol = protocol
            async with asyncio.timeout(ANSWER_S):
                return await protocol.ask(self._request(method, path, body), keep=keep)
        except (OSError, ValueError, IndexError) as error:
            self.close()
            raise OSError(str(error)) from error

    def _request(self, method: str, path: str, body: Any) -> bytes:
        form = isinstance(body, bytes)
        content = body if form else json.dumps(body).encode() if body is not None else b""
        kind = "application/x-www-form-urlencoded" if form else "application/json"
        as_page = f"accept: application/json;clips=hash\r\nauthorization: Bearer {self.token}\r\n"
        token = as_page if self.token else ""
        head = (
            f"{method} {path} HTTP/1.1\r\nhost: localhost\r\ncontent-length: {len(content)}\r\n"
            f"{token}content-type: {kind}\r\n\r\n"
        )
        return head.encode() + content

    def close(self) -> None:
        """Close what is open."""
        if self._protocol is not None and self._protocol.transport is not None:
            self._protocol.transport.close()
        self._protocol = None
