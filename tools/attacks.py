"""The attacks of `tools/attack.py`: each goes on for a time, from a process of its own."""

from __future__ import annotations

import asyncio
import json
import time
import uuid
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from multiprocessing.connection import Connection as Pipe
from typing import Any

from tools import raw_attacks
from tools.load_connection import Connection

CONNECTIONS = 16
SLOW_CONNECTIONS = 200
PIECE = b"%x\r\n%s\r\n" % (1 << 20, b" " * (1 << 20))
PASSWORD = "a wrong but lengthy passphrase"
STUDY = "/api/admin/studies/short"


@dataclass(frozen=True)
class Target:
    """What is attacked: the port, a link to take part, an owner's API token, the attacker's run, a clip."""

    port: int
    link: str
    owner: str
    run: str
    clip: str


Request = tuple[str, str, Any, str]
"""Method, path, body and token."""
Attack = Callable[[Target, float], Awaitable[dict[str, int]]]


async def _flood(
    target: Target, end: float, requests: Iterator[Request], per_second: float
) -> dict[str, int]:
    """Requests at this pace over a few connections; how often each status came."""
    answers: dict[str, int] = {}
    begun, number = time.monotonic(), count()

    async def one() -> None:
        connection = Connection(target.port)
        while (due := begun + next(number) / per_second) < end:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            if time.monotonic() >= end:
                break
            method, path, body, connection.token = next(requests)
            try:
                status = str((await connection.call(method, path, body, keep=False))[0])
            except (OSError, TimeoutError):
                status = "cut"
            answers[status] = answers.get(status, 0) + 1
        connection.close()

    await asyncio.gather(*(one() for _ in range(CONNECTIONS)))
    return answers


def _same(*request: Any) -> Iterator[Request]:
    while True:
        yield request


def _passwords(name: str) -> Iterator[Request]:
    while True:
        body = {"name": name or uuid.uuid4().hex, "password": PASSWORD}
        yield "POST", "/api/admin/session", body, ""


def _codes() -> Iterator[Request]:
    while True:
        path = f"/api/admin/invitations/{uuid.uuid4().hex}/account"
        yield "POST", path, {"name": uuid.uuid4().hex, "password": PASSWORD}, ""


def _invented() -> Iterator[Request]:
    while True:
        body = {"link_token": uuid.uuid4().hex, "reason": "no_webcodecs", "data": {}}
        yield "POST", "/api/unsupported", body, ""


def _starts(link: str) -> Iterator[Request]:
    while True:
        yield "POST", f"/api/links/{link}/runs", {"language": "en", "client_id": str(uuid.uuid4())}, ""


def _pages(owner: str) -> Iterator[Request]:
    while True:
        for page in ("results", "monitor", "runs", "links"):
            yield "GET", f"{STUDY}/{page}", None, owner


async def _stream(target: Target, end: float, path: str, kind: str) -> dict[str, int]:
    """Bodies of 100 MB, piece by piece, as long as the server takes them."""
    head = f"POST {path} HTTP/1.1\r\nhost: x\r\ncontent-type: {kind}\r\ntransfer-encoding: chunked\r\n\r\n"
    sent = {"bodies": 0, "MB taken": 0}

    async def one() -> None:
        while time.monotonic() < end:
            sent["bodies"] += 1
            with suppress(OSError, TimeoutError):
                reader, writer = await asyncio.open_connection("127.0.0.1", target.port)
                writer.write(head.encode())
                for _ in range(100):
                    writer.write(PIECE)
                    await asyncio.wait_for(writer.drain(), 5)
                    sent["MB taken"] += 1
                    if reader.at_eof() or time.monotonic() >= end:
                        break
                writer.transport.abort()
            await asyncio.sleep(0.05)

    await asyncio.gather(*(one() for _ in range(4)))
    return sent


async def _slow(target: Target, end: float) -> dict[str, int]:
    """Many heads of which a byte comes now and then."""
    alive = [await asyncio.open_connection("127.0.0.1", target.port) for _ in range(SLOW_CONNECTIONS)]
    for _, writer in alive:
        writer.write(b"GET / HTTP/1.1\r\nhost: x\r\nx-slow: ")
    while time.monotonic() < end:
        for _, writer in alive:
            with suppress(OSError):
                writer.write(b"x")
        await asyncio.sleep(1)
    for _, writer in alive:
        writer.transport.abort()
    return {"half-sent": len(alive)}


def _flooding(requests: Callable[[Target], Iterator[Request]], per_second: float) -> Attack:
    return lambda target, end: _flood(target, end, requests(target), per_second)


def _streaming(path: str, kind: str) -> Attack:
    return lambda target, end: _stream(target, end, path, kind)


def _raw(requests: Sequence[bytes], per_second: float) -> Attack:
    return lambda target, end: raw_attacks.flood(target.port, end, requests, per_second)


BROKEN, LARGE = {"device": {"browser": "\ud800"}}, {"device": {"browser": "x" * 30_000}}
ATTACKS: dict[str, Attack] = {
    "half a surrogate pair, 50/s": _flooding(lambda t: _same("PUT", "/api/run/device", BROKEN, t.run), 50),
    "100 MB of JSON to sign-in, 4 at once": _streaming("/api/admin/session", "application/json"),
    "100 MB uploads of strangers, 4 at once": _streaming(
        "/api/admin/uploads", "multipart/form-data; boundary=x"
    ),
    "passwords for random names, 100/s": _flooding(lambda _: _passwords(""), 100),
    "passwords for the owner, 100/s": _flooding(lambda _: _passwords("owner"), 100),
    "guessed invitations, 50/s": _flooding(lambda _: _codes(), 50),
    "2,000 links at once, every 2 s": _flooding(
        lambda t: _same("POST", f"{STUDY}/links", {"kind": "personal", "count": 2000}, t.owner), 0.5
    ),
    "dashboards, 10 pages/s": _flooding(lambda t: _pages(t.owner), 10),
    "run starts, 10/s": _flooding(lambda t: _starts(t.link), 10),
    "device reports of 30 kB, 50/s": _flooding(lambda t: _same("PUT", "/api/run/device", LARGE, t.run), 50),
    "200 half-sent requests": _slow,
    "300 streams of one account": lambda target, end: raw_attacks.streams(
        target.port, end, f"{STUDY}/monitor/stream".encode(), target.owner.encode(), 300
    ),
    "ranges of clips that no player asks for, 100/s": lambda target, end: raw_attacks.ranges(
        target.port, end, target.clip.encode(), 100
    ),
    "300 MB of zeros in a zip, SVG as clips, 4/s": lambda target, end: raw_attacks.uploads(
        target.port, end, target.owner.encode(), 4
    ),
    "reset letters for the owner, 50/s": _flooding(
        lambda _: _same("POST", "/api/admin/session/forgotten", {"name": "owner"}, ""), 50
    ),
    "reports of links that do not exist, 100/s": _flooding(lambda _: _invented(), 100),
    **{name: _raw(*sent) for name, sent in raw_attacks.REQUESTS.items()},
}
"""By the name that the table shows."""


def serve(pipe: Pipe, target: Target) -> None:
    """Carry out what the pipe asks for: a name and how many seconds; answer what came of it."""
    while (asked := pipe.recv()) is not None:
        name, seconds = asked
        pipe.send(asyncio.run(_run(name, target, seconds)))


async def _run(name: str, target: Target, seconds: float) -> dict[str, int]:
    return await ATTACKS[name](target, time.monotonic() + seconds)


def begun(answer: bytes) -> str:
    """The token of a run that was begun."""
    return str(json.loads(answer)["run_token"])
