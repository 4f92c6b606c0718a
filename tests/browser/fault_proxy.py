"""A bad network: a small HTTP proxy that drops, doubles, delays and reorders requests, or is off."""

import asyncio
import contextlib
import random
import threading
from collections import Counter
from collections.abc import Coroutine
from typing import Any

from tests.helpers.ports import free_port

HEAD_END = b"\r\n\r\n"
FAULTS = ("drop_request", "drop_answer", "double", "delay", "reorder")
SHORTEST_S, LONGEST_S = 0.05, 0.6


class FaultProxy:
    """Passes requests to `upstream`; `share` of them suffer one of FAULTS, drawn by `seed`.

    lost_once: of each address that begins so, the first request is lost; "" for none.
    """

    def __init__(self, upstream_port: int, share: float, seed: int, lost_once: str = "") -> None:
        self.upstream_port, self.share = upstream_port, share
        self.port = free_port()
        self.offline = False
        self.lost_once = lost_once
        self.lost: set[str] = set()
        self.counts: Counter[str] = Counter()
        self._random = random.Random(seed)
        self._loop = asyncio.new_event_loop()
        self._late: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._ready = threading.Event()

    @property
    def address(self) -> str:
        return f"http://localhost:{self.port}"

    def start(self) -> "FaultProxy":
        self._thread.start()
        self._ready.wait(10)
        return self

    def stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        listening = self._loop.run_until_complete(asyncio.start_server(self._serve, "localhost", self.port))
        self._ready.set()
        self._loop.run_forever()
        listening.close()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0.5))
        self._loop.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
            request = await _read_request(reader)
            answer = b"" if self.offline else await self._pass_on(request)
            writer.write(answer)
            await writer.drain()
        await _closed(writer)

    async def _pass_on(self, request: bytes) -> bytes:
        """The answer, or nothing: the connection then closes without one."""
        self.counts["requests"] += 1
        if self._is_lost(request.split(b" ", 2)[1].decode("latin-1")):
            return b""
        fault = self._random.choice(FAULTS) if self._random.random() < self.share else "none"
        self.counts[fault] += 1
        if fault == "drop_request":
            return b""
        if fault == "delay":
            await self._pause()
        if fault in ("double", "reorder"):
            # The second copy comes late, after requests that were made after it.
            self._later(self._again_later(request))
        if fault == "reorder":
            return b""
        answer = await self._forward(request)
        return b"" if fault == "drop_answer" else answer

    def _is_lost(self, path: str) -> bool:
        if not self.lost_once or not path.startswith(self.lost_once) or path in self.lost:
            return False
        self.lost.add(path)
        return True

    async def _again_later(self, request: bytes) -> None:
        await self._pause()
        await self._forward(request)

    async def _pause(self) -> None:
        await asyncio.sleep(self._random.uniform(SHORTEST_S, LONGEST_S))

    def _later(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._late.add(task)
        task.add_done_callback(self._late.discard)

    async def _forward(self, request: bytes) -> bytes:
        try:
            reader, writer = await asyncio.open_connection("localhost", self.upstream_port)
        except OSError:
            self.counts["server_down"] += 1
            return b""
        try:
            writer.write(request)
            await writer.drain()
            return await reader.read(-1)
        except OSError:
            self.counts["server_down"] += 1
            return b""
        finally:
            await _closed(writer)


async def _closed(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


async def _read_request(reader: asyncio.StreamReader) -> bytes:
    """One request with its body, with the header that closes the connection after it."""
    head = await reader.readuntil(HEAD_END)
    lines = [
        line for line in head[: -len(HEAD_END)].split(b"\r\n") if not line.lower().startswith(b"connection:")
    ]
    sizes = [int(line.split(b":")[1]) for line in lines if line.lower().startswith(b"content-length:")]
    body = await reader.readexactly(sizes[0]) if sizes else b""
    return b"\r\n".join([*lines, b"Connection: close"]) + HEAD_END + body
