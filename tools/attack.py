"""Attacks on a real server while honest raters rate: what clips and ratings take, and the server's memory.

python tools/attack.py                       every attack, about five minutes
python tools/attack.py --database postgres   the same on PostgreSQL, a server of its own
python tools/attack.py --only "passwords for the owner, 100/s" --seconds 20

Before each attack the raters are alone for as long as it lasts, so that each line compares with its own quiet
time. Ends with code 1 where the p95 of clips or ratings is more than doubled (and above 40 ms), a process of
the server took 400 MB or more, or an acknowledged rating is lost. Raters and attacker run on the same cores.
"""

from __future__ import annotations

import argparse
import asyncio
import multiprocessing
import os
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection as Pipe
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rich.console import Console

from server.operations.repository import clip_sizes
from tests.helpers.attacked import api_token
from tools import attacks
from tools.load_client import LoadRater, Tally, percentile
from tools.load_connection import Connection
from tools.load_measures import stored
from tools.load_scenarios import begin, prepare, run
from tools.load_server import LoadServer, load_server

EVERY_S, SETTLE_S = 2.0, 1.0
MAIL = {
    "PALPEBRA_SMTP_HOST": "127.0.0.1",
    "PALPEBRA_SMTP_PORT": "9",
    "PALPEBRA_SMTP_SECURITY": "none",
    "PALPEBRA_MAIL_FROM": "server@lab.example",
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
        """As a row of the table in docs/security.md."""
        times = " | ".join(f"{one[0]:.0f}, {one[1]:.0f}" for one in (self.clips, self.ratings))
        verdict = "withstood" if self.withstood else "falls short"
        return f"| {self.name} | {times} | {self.memory_mb:.0f} | {self.answers} | {verdict} |"


HEAD = (
    "| attack | clip p95 before, during (ms) | rating p95 (ms) | memory (MB) | answers | verdict |\n"
    "|---|---|---|---|---|---|"
)


@contextmanager
def attacker(target: attacks.Target) -> Iterator[Pipe]:
    """A process that attacks when it is asked to."""
    here, there = multiprocessing.get_context("spawn").Pipe()
    process = multiprocessing.get_context("spawn").Process(target=attacks.serve, args=(there, target))
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
    _, answer = await connection.call("POST", f"/api/links/{server.link}/runs", body)
    connection.close()
    return attacks.begun(answer)


def a_clip(server: LoadServer) -> str:
    """Address of one of the study's clips."""
    with server.services.database.read() as session:
        return f"/clips/{clip_sizes(session)[0].sha256}.mp4"


async def attack_all(
    server: LoadServer, names: Sequence[str], raters: int, seconds: float, tally: Tally, console: Console
) -> list[Line]:
    """Every attack after the other, the raters going on all the while."""
    owner = api_token(server.services, "read", "personal", "write", "export", name="owner")
    target = attacks.Target(server.port, server.link, owner, await run_of_attacker(server), a_clip(server))
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
    parser.add_argument("--only", nargs="*", choices=tuple(attacks.ATTACKS), default=tuple(attacks.ATTACKS))
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
