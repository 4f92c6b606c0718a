"""Simulated raters on asyncio: many at once from one process, every answer timed, and what they cost.

They share the cores with the server, so that their HTTP client must cost little.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import time
import uuid
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any

import psutil
import uvloop
from sqlalchemy import select, text

from bench.harness import Row
from bench.servers import LoadServer
from server.models import Rating
from server.rehearsals.person import Person, Rater

EVERY_S = 6.0
AT_ONCE_AT_START = 50
WORKER_KILLS = 20
RETRY_S = 0.2
LONGEST_PAUSE_S = 5.0
GIVE_UP_S = 1800.0
"""A bound for the whole program, far beyond any wait: a page tries as long as it has answers to send."""
NEEDED = ("trial_index", "kind", "check", "plays_done", "prompt", "clips", "clip_sha256", "frames", "fps")
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
        as_page = f"accept: application/json\r\nauthorization: Bearer {self.token}\r\n"
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


@dataclass
class Tally:
    """What the raters saw."""

    start_ms: list[float] = field(default_factory=list)
    rating_ms: list[float] = field(default_factory=list)
    rating_at: list[float] = field(default_factory=list)
    clip_ms: list[float] = field(default_factory=list)
    acknowledged: dict[str, int | None] = field(default_factory=dict)
    failed_starts: int = 0
    retries: int = 0
    given_up: int = 0


class LoadRater:
    """One rater: begins a visit, then rates at a steady pace until stopped."""

    def __init__(self, port: int, link: str, number: int, tally: Tally) -> None:
        self.connection, self.link, self.tally = Connection(port), link, tally
        self.person = Person(None, Rater(number, 1, {}))  # type: ignore[arg-type]
        self.rng = random.Random(number)
        self.trials: list[dict[str, Any]] = []
        self.declared: dict[str, Any] = {}

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
            await self.insist("PUT", "/api/run/consent", {"agreed": True})
            state = json.loads((await self.insist("GET", "/api/run"))[1])
            self.declared = state["trial"]
            # Thousands of raters are in this process: what they do not need is let go.
            self.trials = [{name: trial[name] for name in NEEDED} for trial in state["trials"]]

    async def rate_until(self, end: float, every_s: float) -> None:
        """One clip and one rating each `every_s` seconds, out of step with the others."""
        due = time.monotonic() + self.rng.uniform(0, every_s)
        for trial in self.trials:
            if due >= end:
                break
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            await self._one(trial)
            due += every_s
        self.connection.close()

    async def _one(self, trial: dict[str, Any]) -> None:
        if trial["clip_sha256"]:
            began = time.perf_counter()
            await self.insist("GET", f"/clips/{trial['clip_sha256']}.mp4", keep=False)
            self.tally.clip_ms.append(1000 * (time.perf_counter() - began))
        rating_id = str(uuid.uuid4())
        body = self.person.rating(trial, self.declared)
        began = time.perf_counter()
        status, _ = await self.insist("PUT", f"/api/run/ratings/{rating_id}", body, keep=False)
        self.tally.rating_at.append(began)
        self.tally.rating_ms.append(1000 * (time.perf_counter() - began))
        if status in (200, 201):
            answer = body["answer"]
            is_check = answer["kind"] == "check"
            given = answer["check"] if is_check else answer["answers"]["rating"]["response"]
            self.tally.acknowledged[rating_id] = given

    async def insist(
        self, method: str, path: str, body: Any = None, *, keep: bool = True
    ) -> tuple[int, bytes]:
        """As a page does: the same request again until it is answered by less than 500, pausing longer."""
        ends, pause = time.monotonic() + GIVE_UP_S, RETRY_S
        while time.monotonic() < ends:
            try:
                status, content = await self.connection.call(method, path, body, keep=keep)
                if status < 500:
                    return status, content
            except OSError:
                pass
            self.tally.retries += 1
            await asyncio.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE_S)
        self.tally.given_up += 1
        return 599, b""


def run(work: Coroutine[Any, Any, None]) -> None:
    """As asyncio.run, on the faster loop: the raters share the cores with the server."""
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(work)


async def begin(server: LoadServer, count: int, tally: Tally, at_once: int) -> list[LoadRater]:
    """Raters with their visits begun, `at_once` at a time."""
    raters = [LoadRater(server.port, server.link_token, number, tally) for number in range(count)]
    gate = asyncio.Semaphore(at_once)

    async def one(rater: LoadRater) -> None:
        async with gate:
            await rater.begin()

    await asyncio.gather(*(one(rater) for rater in raters))
    return raters


async def prepare(raters: list[LoadRater]) -> None:
    """Consent and list of trials of all."""
    gate = asyncio.Semaphore(AT_ONCE_AT_START)

    async def one(rater: LoadRater) -> None:
        async with gate:
            await rater.prepare()

    await asyncio.gather(*(one(rater) for rater in raters))


async def rate(raters: list[LoadRater], seconds: float, fire: Callable[[int], None] | None = None) -> None:
    """Let them rate for so long; `fire` is called WORKER_KILLS times, evenly spread."""
    end = time.monotonic() + seconds
    work = [asyncio.create_task(rater.rate_until(end, EVERY_S)) for rater in raters]
    if fire is not None:
        for number in range(WORKER_KILLS):
            await asyncio.sleep(seconds / (WORKER_KILLS + 1))
            await asyncio.to_thread(fire, number)
    await asyncio.gather(*work)


class Clocks:
    """Processor time from its making on: server, database, the raters here, and all else on this machine."""

    def __init__(self, server: LoadServer) -> None:
        self.server = server
        self.used: dict[str, float] = {}
        self.cores_s = 0.0
        self.memory_mb: list[float] = []
        self.began, self._then = time.monotonic(), self._now()

    def _now(self) -> dict[str, float]:
        idle = psutil.cpu_times()
        return {
            "server": self.server.cpu_s(),
            "database": self.server.database.cpu_s(),
            "raters": time.process_time(),
            "machine": sum(idle) - idle.idle - getattr(idle, "iowait", 0.0) - getattr(idle, "guest", 0.0),
        }

    def stop(self) -> None:
        """Read them for the last time, and the memory of each process of the server."""
        self.memory_mb = [process.memory_info().rss / 1e6 for process in self.server.processes()]
        self.used = {name: value - self._then[name] for name, value in self._now().items()}
        self.used["others"] = max(0.0, 2 * self.used["machine"] - sum(self.used.values()))
        self.cores_s = (time.monotonic() - self.began) * (os.cpu_count() or 1)

    def rows(self, ratings: int) -> list[Row]:
        """Processor time per rating, and the share of all cores each has used."""
        each = [self.used[process] / max(1, ratings) for process in ("server", "database", "raters")]
        shares = [self.used[process] / self.cores_s for process in ("server", "database", "raters", "others")]
        said = " / ".join(f"{1000 * cost:.2f}" for cost in each)
        memory = ", ".join(f"{one:.0f}" for one in self.memory_mb)
        split = " / ".join(f"{100 * share:.0f}" for share in shares)
        return [
            Row("", "CPU per rating with its clip: server / database / raters (ms)", said),
            Row("", "share of the cores: server / database / raters / others (%)", split),
            Row("", "memory of each process of the server (MB)", memory),
        ]


def rated(server: LoadServer, count: int, seconds: float) -> tuple[Tally, Clocks]:
    """What `count` raters saw, and the clocks since they all had begun; they are read when this ends."""
    tally, clocks = Tally(), []

    async def go() -> None:
        raters = await begin(server, count, tally, AT_ONCE_AT_START)
        await prepare(raters)
        clocks.append(Clocks(server))
        await rate(raters, seconds)
        clocks[0].stop()

    run(go())
    return tally, clocks[0]


def stored(server: LoadServer, tally: Tally) -> tuple[int, int]:
    """Acknowledged ratings that are not in the database as sent, and ratings stored twice."""
    with server.opened.database.read() as session:
        answers = session.execute(select(Rating.rating_id, Rating.payload))
        responses = {
            rating_id: payload.get("response", payload.get("check")) for rating_id, payload in answers
        }
        plays = session.execute(
            text(
                "SELECT count(*) FROM (SELECT 1 FROM trial_ratings "
                "GROUP BY study_run_id, trial_index, play HAVING count(*) > 1) AS twice"
            )
        ).scalar_one()
    lost = sum(responses.get(rating_id, "none") != value for rating_id, value in tally.acknowledged.items())
    return lost, int(plays)


def saved(server: LoadServer, tally: Tally) -> Row:
    """Whether everything acknowledged is there, once."""
    lost, twice = stored(server, tally)
    counts = (lost, twice, tally.given_up)
    said = "; ".join(map(str, counts))
    return Row("", "lost; stored twice; given up", said, "0; 0; 0", counts == (0, 0, 0))
