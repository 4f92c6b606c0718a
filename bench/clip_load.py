"""Clips as fast as they come: from the server itself, and from nginx in front of it."""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import os
import socket
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select

from bench.harness import Row
from bench.servers import CLIP_BYTES, LoadServer, load_server, nginx, nginx_program
from server.models import Clip

CONNECTIONS = 8
CLIPS_ASKED_FOR = 40
BUFFER_BYTES = 1 << 20
# Linux lets go of what a TCP connection brought without copying it: the driver then costs next to nothing.
DISCARDED = getattr(socket, "MSG_TRUNC", 0) if os.uname().sysname == "Linux" else 0


@dataclass(frozen=True)
class Throughput:
    """What came in a stretch of time, and the processor time of who sent it and of who asked."""

    clips: int
    seconds: float
    sender_s: float
    driver_s: float

    @property
    def per_s(self) -> float:
        """Clips a second."""
        return self.clips / self.seconds

    @property
    def cost_ms(self) -> float:
        """The sender's processor time per clip."""
        return 1000 * self.sender_s / max(1, self.clips)

    @property
    def per_core_s(self) -> float:
        """Clips in one second of one core's time of the sender."""
        return 1000 / self.cost_ms if self.cost_ms else math.nan

    def said(self) -> str:
        """For the table."""
        share = 100 * self.driver_s / (self.seconds * (os.cpu_count() or 1))
        rate = self.per_s * CLIP_BYTES / 1e6
        return f"{self.per_s:.0f} ({rate:.0f} MB/s); {self.cost_ms:.3f}; {share:.0f}"


def proxied_clips(seconds: float, ratio: float) -> list[Row]:
    """Clips of a folder from the server and from nginx, which has them after it was asked once for each."""
    program = nginx_program()
    if program is None:
        return [Row("clips behind the proxy", "skipped", "nginx is not installed here")]
    with load_server("sqlite", 1) as server, tempfile.TemporaryDirectory(prefix="palpebra-nginx-") as folder:
        paths = addresses(server)
        own = measured(server.port, paths, seconds, server.cpu_s)
        with nginx(program, Path(folder), server.port) as proxy:
            proxied = measured(proxy.port, paths, seconds, proxy.cpu_s)
    times = proxied.per_core_s / own.per_core_s
    what = "clips/s; sender's processor time per clip (ms); driver's share of the cores (%)"
    return [
        Row(
            f"clips of {CLIP_BYTES / 1000:.0f} kB, {CONNECTIONS} connections",
            f"server itself: {what}",
            own.said(),
        ),
        Row("", f"nginx in front: {what}", proxied.said()),
        Row("", "throughput behind nginx, in the server's own", f"{proxied.per_s / own.per_s:.1f}"),
        Row("", "the same for each core that sends", f"{times:.1f}", f">= {ratio:g}", times >= ratio),
    ]


def addresses(server: LoadServer) -> list[str]:
    """The addresses of some clips."""
    with server.opened.database.read() as session:
        hashes = session.scalars(select(Clip.sha256).order_by(Clip.sha256).limit(CLIPS_ASKED_FOR)).all()
    return [f"/clips/{one}.mp4" for one in hashes]


def measured(port: int, paths: list[str], seconds: float, cpu_s: Callable[[], float]) -> Throughput:
    """Ask once for each clip and look whether it is that; then as fast as they come, from a process."""
    for path in paths:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}") as answer:
            if hashlib.sha256(answer.read()).hexdigest() not in path:
                raise RuntimeError(f"another clip than {path} came")
    context = multiprocessing.get_context("spawn")
    said = context.SimpleQueue()
    process = context.Process(target=ask, args=(port, paths, seconds, said))
    began_cpu = cpu_s()
    process.start()
    number, took, driver_s = said.get()
    sender_s = cpu_s() - began_cpu
    process.join()
    return Throughput(number, took, sender_s, driver_s)


def ask(
    port: int, paths: list[str], seconds: float, said: multiprocessing.SimpleQueue[tuple[int, float, float]]
) -> None:
    """Let `CONNECTIONS` ask for one clip after the other, for so long."""
    counts, began, used = [0] * CONNECTIONS, time.monotonic(), time.process_time()
    end = began + seconds
    threads = [
        threading.Thread(target=_one, args=(port, paths, end, counts, number))
        for number in range(CONNECTIONS)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    said.put((sum(counts), time.monotonic() - began, time.process_time() - used))


def _one(port: int, paths: list[str], end: float, counts: list[int], number: int) -> None:
    buffer = memoryview(bytearray(BUFFER_BYTES))
    requests = [f"GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n".encode() for path in paths]
    while time.monotonic() < end:
        with socket.create_connection(("127.0.0.1", port)) as connection:
            while time.monotonic() < end:
                try:
                    connection.sendall(requests[(number + counts[number]) % len(requests)])
                    taken = _take(connection, buffer)
                except ConnectionError:  # closed while the request was on its way
                    taken = False
                if not taken:
                    break
                counts[number] += 1


def _take(connection: socket.socket, buffer: memoryview) -> bool:
    """Take one answer; False where the connection was closed instead, as nginx does after 1,000."""
    head = bytearray()
    while (ends := head.find(b"\r\n\r\n")) < 0:
        more = connection.recv(1024)
        if not more:
            return False
        head += more
    if not head.startswith(b"HTTP/1.1 200"):
        raise RuntimeError(f"expected a clip, got {bytes(head[:40])!r}")
    lines = bytes(head[:ends]).lower().split(b"\r\n")
    length = next(int(line.split(b":")[1]) for line in lines if line.startswith(b"content-length:"))
    left = length - (len(head) - ends - 4)
    while left > 0:
        got = connection.recv_into(buffer, min(left, len(buffer)), DISCARDED)
        if not got:
            raise RuntimeError("the connection ended within a clip")
        left -= got
    return True
