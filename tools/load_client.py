"""Simulated raters on asyncio for `make load`: many at once from one process, every answer timed."""

from __future__ import annotations

import asyncio
import json
import random
import time
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from server.simulation.person import Person, Rater

RETRY_S = 0.2
GIVE_UP_S = 90.0


@dataclass
class Tally:
    """What the raters saw."""

    start_ms: list[float] = field(default_factory=list)
    rating_ms: list[float] = field(default_factory=list)
    clip_ms: list[float] = field(default_factory=list)
    acknowledged: dict[str, int | None] = field(default_factory=dict)
    failed_starts: int = 0
    retries: int = 0
    given_up: int = 0

    def percentile(self, values: Sequence[float], share: float) -> float:
        """The value below which `share` of them lie; not a number where there is none."""
        ordered = sorted(values)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")


class Connection:
    """One kept-alive HTTP connection; opened again after a failure."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.token = ""
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def call(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        """Status and content; OSError where the connection broke."""
        try:
            if self._streams is None:
                self._streams = await asyncio.open_connection("127.0.0.1", self.port, limit=1 << 22)
            reader, writer = self._streams
            content = json.dumps(body).encode() if body is not None else b""
            head = f"{method} {path} HTTP/1.1\r\nhost: localhost\r\ncontent-length: {len(content)}\r\n"
            if self.token:
                head += f"authorization: Bearer {self.token}\r\n"
            writer.write(f"{head}content-type: application/json\r\n\r\n".encode() + content)
            answered = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
            length = int(answered.split("content-length:")[1].split("\r\n")[0])
            return int(answered.split()[1]), await reader.readexactly(length)
        except (OSError, EOFError, asyncio.LimitOverrunError) as error:
            self.close()
            raise OSError(str(error)) from error

    def close(self) -> None:
        """Close what is open."""
        if self._streams is not None:
            self._streams[1].close()
            self._streams = None

    async def insist(self, tally: Tally, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        """As a page does: the same request again until it is answered by less than 500."""
        ends = time.monotonic() + GIVE_UP_S
        while time.monotonic() < ends:
            try:
                status, content = await self.call(method, path, body)
                if status < 500:
                    return status, content
            except OSError:
                pass
            tally.retries += 1
            await asyncio.sleep(RETRY_S)
        tally.given_up += 1
        return 599, b""


class LoadRater:
    """One rater: begins a visit, then rates at a steady pace until told to stop."""

    def __init__(self, port: int, link: str, number: int, tally: Tally) -> None:
        self.connection, self.link, self.tally = Connection(port), link, tally
        self.person = Person(None, Rater(number, 1, {}))  # type: ignore[arg-type]
        self.rng = random.Random(number)
        self.state: dict[str, Any] = {}

    async def begin(self) -> None:
        """Start the run; counted as failed where it is not."""
        body = {"language": "en", "client_id": str(uuid.uuid4()), "device": {"simulated": True}}
        began = time.perf_counter()
        try:
            status, content = await self.connection.call("POST", f"/api/links/{self.link}/runs", body)
        except OSError:
            status, content = 599, b""
        self.tally.start_ms.append(1000 * (time.perf_counter() - began))
        if status != 201:
            self.tally.failed_starts += 1
            return
        self.connection.token = json.loads(content)["run_token"]

    async def prepare(self) -> None:
        """Consent, and the list of trials."""
        if self.connection.token:
            await self.connection.insist(self.tally, "PUT", "/api/run/consent", {"agreed": True})
            self.state = json.loads((await self.connection.insist(self.tally, "GET", "/api/run"))[1])

    async def rate_until(self, end: float, every_s: float) -> None:
        """One clip and one rating each `every_s` seconds, out of step with the others."""
        due = time.monotonic() + self.rng.uniform(0, every_s)
        for trial in self.state.get("trials", []):
            if due >= end:
                break
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            await self._one(trial)
            due += every_s
        self.connection.close()

    async def _one(self, trial: dict[str, Any]) -> None:
        if trial["clip_sha256"]:
            began = time.perf_counter()
            await self.connection.insist(self.tally, "GET", f"/clips/{trial['clip_sha256']}.mp4")
            self.tally.clip_ms.append(1000 * (time.perf_counter() - began))
        rating_id = str(uuid.uuid4())
        body = self.person.rating(trial, self.state["trial"]["scale"])
        began = time.perf_counter()
        status, _ = await self.connection.insist(self.tally, "PUT", f"/api/run/ratings/{rating_id}", body)
        self.tally.rating_ms.append(1000 * (time.perf_counter() - began))
        if status in (200, 201):
            self.tally.acknowledged[rating_id] = body["response"]
