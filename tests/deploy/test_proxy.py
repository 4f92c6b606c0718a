"""A real Caddy with the deployment's Caddyfile: what it lets through to the server, and what not."""

import os
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from bench.raw_attacks import LENGTHS, SMUGGLED
from server.core.settings import Settings
from server.request_limits import ANONYMOUS_BYTES, SIGNED_IN_BYTES
from tests.conftest import REPOSITORY
from tests.helpers.ports import free_port

RUN_BYTES = Settings.model_fields["max_body_bytes"].default
LIMITS = {
    "/api/links/x/runs": ANONYMOUS_BYTES,
    "/clips/x.mp4": ANONYMOUS_BYTES,
    "/api/admin/session": ANONYMOUS_BYTES,
    "/api/admin/invitations/x/account": ANONYMOUS_BYTES,
    "/api/run/ratings/x": RUN_BYTES,
    "/api/admin/studies": SIGNED_IN_BYTES,
}


class Reached(BaseHTTPRequestHandler):
    """Stands for the server: remembers which requests came whole."""

    protocol_version = "HTTP/1.1"
    came: list[str]

    def do_POST(self) -> None:
        """Read the body to its end and answer."""
        left = int(self.headers["content-length"] or 0)
        while left > 0 and (piece := self.rfile.read(min(left, 1 << 16))):
            left -= len(piece)
        if left == 0:
            self.came.append(self.path)
        self.send_response(200)
        self.send_header("content-length", "0")
        self.end_headers()

    do_GET = do_POST

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, list[str]]]:
    """The port of a Caddy before a server, and the paths of the requests that came to that."""
    program = shutil.which("caddy")
    if program is None:
        pytest.skip("no caddy on this machine")
    came: list[str] = []
    tmp_path = tmp_path_factory.mktemp("caddy")
    server = ThreadingHTTPServer(("127.0.0.1", 0), type("Handler", (Reached,), {"came": came}))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    port, text = free_port(), (REPOSITORY / "deploy" / "Caddyfile").read_text(encoding="utf-8")
    text = text.replace("{$DOMAIN}", f"http://127.0.0.1:{port}").replace(
        "server:8000", f"127.0.0.1:{server.server_port}"
    )
    (tmp_path / "Caddyfile").write_text("{\n\tadmin off\n" + text[text.index("{") + 2 :])
    command = [program, "run", "--config", str(tmp_path / "Caddyfile"), "--adapter", "caddyfile"]
    homes = {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    with subprocess.Popen(command, env={**os.environ, **homes}, stderr=subprocess.DEVNULL) as process:
        until = time.monotonic() + 60
        while (
            time.monotonic() < until
            and status(port, b"GET /healthz HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n") == 0
        ):
            time.sleep(0.1)
        yield port, came
        process.terminate()
    server.shutdown()
    server.server_close()


@pytest.fixture
def proxy(started: tuple[int, list[str]]) -> tuple[int, list[str]]:
    """The same, none having come yet."""
    started[1].clear()
    return started


def status(port: int, sent: bytes) -> int:
    """The status of the first answer; 0 where none came."""
    try:
        with socket.create_connection(("127.0.0.1", port), 20) as connection:
            connection.sendall(sent)
            return int(connection.recv(1000)[9:12] or 0)
    except OSError:
        return 0


def post(path: str, size: int) -> bytes:
    head = f"POST {path} HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-length: {size}\r\n\r\n"
    return head.encode() + b" " * size


@pytest.mark.parametrize("path", LIMITS)
def test_bodies_are_bounded_as_the_server_bounds_them(proxy: tuple[int, list[str]], path: str) -> None:
    port, came = proxy
    assert (status(port, post(path, LIMITS[path])), came) == (200, [path])
    status(port, post(path, LIMITS[path] + 1))
    assert came == [path]


def test_metrics_and_readiness_are_not_for_the_world(proxy: tuple[int, list[str]]) -> None:
    port, came = proxy
    for path in ("/metrics", "/readyz"):
        assert status(port, f"GET {path} HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n".encode()) == 404
    assert came == []


def test_no_second_request_is_smuggled_to_the_server(proxy: tuple[int, list[str]]) -> None:
    port, came = proxy
    head = b"POST /api/admin/session HTTP/1.1\r\nhost: 127.0.0.1\r\n"
    for lengths in LENGTHS:
        came.clear()
        with socket.create_connection(("127.0.0.1", port), 20) as connection:
            connection.sendall(head + lengths + b"\r\n0\r\n\r\n" + SMUGGLED)
            connection.settimeout(0.5)
            said = _all(connection)
        # What Caddy itself took for a second request it answered by itself; no other reached the server.
        assert len(came) <= said.count(b"HTTP/1.1 200"), (lengths, came, said)


def _all(connection: socket.socket) -> bytes:
    said = b""
    with suppress(OSError):
        while piece := connection.recv(1 << 16):
            said += piece
    return said
