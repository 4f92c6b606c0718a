"""Attacks on a real server while honest raters rate: what clips and ratings take, and the server's memory.

python -m bench.attack                       every attack, about five minutes
python -m bench.attack --database postgres   the same on a separate PostgreSQL server
python -m bench.attack --only "passwords for the owner, 100/s" --seconds 20

Before each attack the raters are alone for as long as it lasts, so that each line compares with its own quiet
time. Ends with code 1 where the p95 of clips or ratings is more than doubled (and above 40 ms), a process of
the server took 400 MB or more, or an acknowledged rating is lost. Raters and attacker run on the same cores.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import os
import sys
import time
import uuid
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from multiprocessing.connection import Connection as Pipe
from pathlib import Path
from typing import Any

from rich.console import Console

from bench import raw_attacks
from bench.harness import percentile
from bench.raters import Connection, LoadRater, Tally, begin, prepare, run, stored
from bench.servers import LoadServer, load_server
from server.operations.repository import clip_sizes
from tests.helpers.attacked import api_token

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


EVERY_S, SETTLE_S = 2.0, 1.0
MAIL = {
    "smtp_host": "127.0.0.1",
    "smtp_port": "9",
    "smtp_security": "none",
    "mail_from": "server@lab.example",
}
"""Where reset letters would go: nobody listens there."""
TIMES, FLOOR_MS, MAX_MB = 2.0, 40.0, 400.0


@dataclass(frozen=True)
class Line:
    """One attack: p95 in ms of clips and ratings, before and during it; the server's highest memory."""

    name: str
    clips: tuple[float, float]
    ratings: tuple[float, float]
    memory_mb: float
    answers: str

    @property
    def withstood(self) -> bool:
        """Whether both are at most doubled, or quick, and memory is bounded."""
        quick = all(after <= max(TIMES * before, FLOOR_MS) for before, after in (self.clips, self.ratings))
        return quick and self.memory_mb < MAX_MB

    def markdown(self) -> str:
        """As a row of the table in docs/explanation/security.md."""
        times = " | ".join(f"{one[0]:.0f}, {one[1]:.0f}" for one in (self.clips, self.ratings))
        verdict = "withstood" if self.withstood else "falls short"
        return f"| {self.name} | {times} | {self.memory_mb:.0f} | {self.answers} | {verdict} |"


HEAD = (
    "| attack | clip p95 before, during (ms) | rating p95 (ms) | memory (MB) | answers | verdict |\n"
    "|---|---|---|---|---|---|"
)


@contextmanager
def attacker(target: Target) -> Iterator[Pipe]:
    """A process that attacks when it is asked to."""
    here, there = multiprocessing.get_context("spawn").Pipe()
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(there, target))
    process.start()
    try:
        yield here
    finally:
        here.send(None)
        process.join(30)
        process.kill()


def peak_mb(server: LoadServer, *, reset: bool = False) -> float:
    """Highest resident memory of any process of the server since the last reset (Linux)."""
    highest = 0.0
    for process in server.processes():
        folder = Path(f"/proc/{process.pid}")
        with suppress(OSError):
            if reset:
                (folder / "clear_refs").write_text("5")
            status = (folder / "status").read_text()
            highest = max(highest, int(status.partition("VmHWM:")[2].split()[0]) / 1024)
    return highest


async def measured(name: str, seconds: float, server: LoadServer, tally: Tally, pipe: Pipe) -> Line:
    """A quiet time, then the attack."""
    marks = [(len(tally.clip_ms), len(tally.rating_ms))]
    await asyncio.sleep(seconds)
    marks.append((len(tally.clip_ms), len(tally.rating_ms)))
    peak_mb(server, reset=True)
    pipe.send((name, seconds))
    await asyncio.sleep(seconds)
    marks.append((len(tally.clip_ms), len(tally.rating_ms)))
    answers = await asyncio.to_thread(pipe.recv)
    memory = peak_mb(server)
    await asyncio.sleep(SETTLE_S)
    said = ", ".join(f"{number} x {what}" for what, number in sorted(answers.items()))
    clips, ratings = (
        _p95(values, [mark[row] for mark in marks])
        for row, values in enumerate((tally.clip_ms, tally.rating_ms))
    )
    return Line(name, clips, ratings, memory, said)


def _p95(values: Sequence[float], marks: Sequence[int]) -> tuple[float, float]:
    quiet, attacked = values[marks[0] : marks[1]], values[marks[1] : marks[2]]
    return percentile(quiet, 0.95), percentile(attacked, 0.95)


async def run_of_attacker(server: LoadServer) -> str:
    """Begin a run; gives its token."""
    connection = Connection(server.port)
    body = {"language": "en", "client_id": str(uuid.uuid4())}
    _, answer = await connection.call("POST", f"/api/links/{server.link_token}/runs", body)
    connection.close()
    return begun(answer)


def a_clip(server: LoadServer) -> str:
    """Address of one of the study's clips."""
    with server.opened.database.read() as session:
        return f"/clips/{clip_sizes(session)[0].sha256}.mp4"


async def attack_all(
    server: LoadServer, names: Sequence[str], raters: int, seconds: float, tally: Tally, console: Console
) -> list[Line]:
    """Every attack after the other, the raters going on all the while."""
    owner = api_token(server.opened, "read", "personal", "write", "export", name="owner")
    target = Target(server.port, server.link_token, owner, await run_of_attacker(server), a_clip(server))
    people: list[LoadRater] = await begin(server, raters, tally, 10)
    await prepare(people)
    lines: list[Line] = []
    with attacker(target) as pipe:
        pipe.send((names[0], 0.0))  # it has imported everything once it answers
        await asyncio.to_thread(pipe.recv)
        ends = time.monotonic() + len(names) * (2 * seconds + SETTLE_S) + 60
        # Slower where their trials would run out before the last attack.
        pace = max(EVERY_S, 1.1 * (ends - time.monotonic()) / len(people[0].trials))
        rating = [asyncio.create_task(one.rate_until(ends, pace)) for one in people]
        await asyncio.sleep(2 * EVERY_S)
        for name in names:
            lines.append(await measured(name, seconds, server, tally, pipe))
            console.print(lines[-1].markdown())
        for task in rating:
            if task.done():
                task.result()  # a rater that broke down
            task.cancel()
        await asyncio.gather(*rating, return_exceptions=True)
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=12, help="length of each attack (12)")
    parser.add_argument(
        "--raters",
        type=int,
        default=40,
        help="honest raters, a clip and a rating each 2 s, or slower in a long run (40)",
    )
    parser.add_argument("--only", nargs="*", choices=tuple(ATTACKS), default=tuple(ATTACKS))
    parser.add_argument("--database", choices=("sqlite", "postgres"), default="sqlite")
    asked = parser.parse_args()
    console, tally, lines = Console(width=200), Tally(), list[Line]()
    console.print(f"{os.cpu_count()} cores, load before: {os.getloadavg()[0]:.1f}")
    console.print(HEAD)
    with load_server(asked.database, 1, **MAIL) as server:

        async def go() -> None:
            lines.extend(await attack_all(server, asked.only, asked.raters, asked.seconds, tally, console))

        run(go())
        lost, twice = stored(server, tally)
    console.print(f"{len(tally.acknowledged)} ratings acknowledged; lost {lost}; stored twice {twice}")
    console.print(f"load after: {os.getloadavg()[0]:.1f}")
    return int(lost + twice > 0 or not all(line.withstood for line in lines))


if __name__ == "__main__":
    sys.exit(main())
