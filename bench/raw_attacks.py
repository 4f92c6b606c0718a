"""Attacks of `bench/attack.py` by what no HTTP client sends: each request as its bytes."""

from __future__ import annotations

import asyncio
import io
import time
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from itertools import count, cycle

CONNECTIONS = 16
HEAD = b"host: 127.0.0.1\r\n"
DEPTH = 30_000
DEEP = b"[" * DEPTH + b"]" * DEPTH
DIGITS = b"9" * 5000
BOMB_MB = 300
RANGES = (b",".join([b"0-1"] * 5000), b"0-,0-,0-", b"-0", b"5-2", DIGITS + b"-", b"0-" + b"9" * 15, b"a-b")
SMUGGLED = b"GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n"
LENGTHS = (
    b"content-length: 6\r\ntransfer-encoding: chunked\r\n",
    b"transfer-encoding: chunked\r\ncontent-length: 6\r\n",
    b"content-length: 27\r\ncontent-length: 5\r\n",
    b"content-length: 27, 27\r\n",
    b"content-length: +5\r\n",
    b"content-length: -1\r\n",
    b"transfer-encoding: xchunked\r\n",
    b"transfer-encoding: chunked, identity\r\n",
    b"transfer-encoding : chunked\r\n",
)
"""Heads of which a proxy and a server may each believe another end."""


def request(method: bytes, path: bytes, head: bytes = b"", body: bytes = b"") -> bytes:
    """A request's bytes."""
    length = b"content-length: %d\r\n" % len(body) if body else b""
    return b"%s %s HTTP/1.1\r\n%s%s%s\r\n%s" % (method, path, HEAD, head, length, body)


async def flood(port: int, end: float, requests: Sequence[bytes], per_second: float) -> dict[str, int]:
    """The requests in turn at this pace, each on a separate connection; how often each status came."""
    answers: dict[str, int] = {}
    begun, number, ready = time.monotonic(), count(), cycle(requests)

    async def one() -> None:
        while (due := begun + next(number) / per_second) < end:
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            if time.monotonic() >= end:
                return
            status = await _status(port, next(ready))
            answers[status] = answers.get(status, 0) + 1

    await asyncio.gather(*(one() for _ in range(CONNECTIONS)))
    return answers


async def _status(port: int, sent: bytes) -> str:
    with suppress(OSError, TimeoutError):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(sent)
        line = await asyncio.wait_for(reader.readline(), 10)
        writer.transport.abort()
        return line[9:12].decode("latin-1") or "cut"
    return "cut"


async def ranges(port: int, end: float, clip: bytes, per_second: float) -> dict[str, int]:
    """Parts of a clip that no player asks for."""
    asked = [request(b"GET", clip, b"range: bytes=%s\r\n" % part) for part in RANGES]
    return await flood(port, end, asked, per_second)


async def uploads(port: int, end: float, token: bytes, per_second: float) -> dict[str, int]:
    """Archives of zeros that unpack to a thousand times their size, and pictures that would run script."""
    head = b"authorization: Bearer %s\r\ncontent-type: multipart/form-data; boundary=x\r\n" % token
    sent = [
        request(b"POST", b"/api/admin/uploads", head, _form(name, body))
        for name, body in ((b"zeros.zip", zeros(BOMB_MB)), (b"a.svg", b"<svg onload='alert(1)'/>"))
    ]
    return await flood(port, end, sent, per_second)


@cache
def zeros(megabytes: int) -> bytes:
    """An archive with one file of so many MB of zeros."""
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("a.mp4", "w", force_zip64=True) as file,
    ):
        for _ in range(megabytes):
            file.write(bytes(1 << 20))
    return packed.getvalue()


def _form(name: bytes, body: bytes) -> bytes:
    disposition = b'content-disposition: form-data; name="files"; filename="%s"' % name
    return b"--x\r\n%s\r\n\r\n%s\r\n--x--\r\n" % (disposition, body)


async def streams(port: int, end: float, path: bytes, token: bytes, number: int) -> dict[str, int]:
    """Streams that are left open, and read; how often each status came."""
    asked = request(b"GET", path, b"authorization: Bearer %s\r\n" % token)
    answers: dict[str, int] = {}

    async def one() -> None:
        with suppress(OSError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(asked)
            with suppress(TimeoutError):
                async with asyncio.timeout_at(asyncio.get_running_loop().time() + end - time.monotonic()):
                    status = (await reader.readline())[9:12].decode("latin-1") or "cut"
                    answers[status] = answers.get(status, 0) + 1
                    while await reader.read(1 << 16):
                        pass
            writer.transport.abort()

    await asyncio.gather(*(one() for _ in range(number)))
    return answers


JSON = b"content-type: application/json\r\n"
UPGRADE = (
    b"upgrade: websocket\r\nconnection: upgrade\r\nsec-websocket-version: 13\r\n"
    b"sec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
REQUESTS: dict[str, tuple[list[bytes], float]] = {
    "JSON nested 30,000 deep, 50/s": (
        [
            request(b"POST", b"/api/admin/session", JSON, DEEP),
            request(b"POST", b"/api/unsupported", JSON, DEEP),
        ],
        50,
    ),
    "3,000 headers, queries of 60 kB, 50/s": (
        [
            request(b"GET", b"/readyz", b"".join(b"x-%d: a\r\n" % number for number in range(3000))),
            request(b"GET", b"/api/run?" + b"a=1&" * 15_000),
        ],
        50,
    ),
    "two lengths, or a length and chunks, 50/s": (
        [
            b"POST /api/admin/session HTTP/1.1\r\n%s%s\r\n0\r\n\r\n%s" % (HEAD, lengths, SMUGGLED)
            for lengths in LENGTHS
        ],
        50,
    ),
    "websocket upgrades, 50/s": ([request(b"GET", b"/api/run", UPGRADE)], 50),
    "forged cookies and tokens, 50/s": (
        [
            request(b"GET", b"/api/admin/studies", b"cookie: palpebra_session=%s\r\n" % DIGITS),
            request(b"GET", b"/api/run", b"authorization: Bearer %s\r\n" % DIGITS),
        ],
        50,
    ),
    "paths out of the folders, names no file can have, 100/s": (
        [
            request(b"GET", b"/assets/admin/" + name)
            for name in (b"%00", b"..%2f..%2fpyproject.toml", b"%252e%252e/x", b"x" * 3000)
        ]
        + [request(b"GET", b"/clips/..%2f..%2fpalpebra.sqlite.mp4")],
        100,
    ),
}
"""By the name that the table shows: the requests, and how many a second."""
