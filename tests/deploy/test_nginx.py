"""`deploy/nginx.conf`: as strict as the Caddyfile, and clips are asked of the server once."""

import shutil
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from bench.servers import nginx, nginx_configuration, nginx_program
from tests.conftest import REPOSITORY

CLIP = bytes(range(256)) * 1000
ADDRESS = f"/clips/{'ab' * 32}.mp4"
TEXT = (REPOSITORY / "deploy" / "nginx.conf").read_text(encoding="utf-8")


class Upstream(BaseHTTPRequestHandler):
    """Answers as the server does, and remembers what it was asked."""

    protocol_version = "HTTP/1.1"
    asked: list[tuple[str, str]]

    def do_GET(self) -> None:
        """Send the clip, whatever is asked for."""
        self.asked.append((self.path, self.headers["x-forwarded-for"]))
        self.send_response(200)
        self.send_header("content-type", "video/mp4")
        self.send_header("content-length", str(len(CLIP)))
        self.send_header("accept-ranges", "bytes")
        if self.path.startswith("/clips/"):
            self.send_header("cache-control", "public, max-age=31536000, immutable")
        self.end_headers()
        self.wfile.write(CLIP)

    def do_POST(self) -> None:
        """Take what is sent."""
        self.asked.append((self.path, self.headers["x-forwarded-for"]))
        self.rfile.read(int(self.headers["content-length"]))
        self.send_response(201)
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@contextmanager
def upstream() -> Iterator[tuple[int, list[tuple[str, str]]]]:
    asked: list[tuple[str, str]] = []
    handler = type("Handler", (Upstream,), {"asked": asked})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_address[1], asked
    server.shutdown()
    server.server_close()


@pytest.fixture
def program() -> str:
    found = nginx_program()
    if found is None:
        pytest.skip("nginx is not installed here")
    return found


def answer(port: int, path: str, **headers: str) -> tuple[int, bytes]:
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=30) as got:
            return got.status, got.read()
    except urllib.error.HTTPError as refused:
        return refused.code, b""


def test_a_clip_is_asked_of_the_server_once_and_sent_whole_or_in_parts(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, asked), nginx(program, tmp_path, behind) as proxy:
        assert answer(proxy.port, ADDRESS) == (200, CLIP)
        assert answer(proxy.port, ADDRESS) == (200, CLIP)
        assert answer(proxy.port, ADDRESS, Range="bytes=10-19") == (206, CLIP[10:20])
        assert asked == [(ADDRESS, "127.0.0.1")]
        # By its own word a client is nobody else.
        for _ in range(2):
            assert answer(proxy.port, "/api/links/a", **{"x-forwarded-for": "9.9.9.9"})[0] == 200
        assert asked[1:] == 2 * [("/api/links/a", "127.0.0.1")]


def test_a_first_part_leaves_the_whole_clip_behind(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, asked), nginx(program, tmp_path, behind) as proxy:
        assert answer(proxy.port, ADDRESS, Range="bytes=0-9") == (206, CLIP[:10])
        assert answer(proxy.port, ADDRESS) == (200, CLIP)
        assert len(asked) == 1


def test_operations_are_not_for_the_world_and_bodies_are_bounded(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, _), nginx(program, tmp_path, behind) as proxy:
        assert [answer(proxy.port, path)[0] for path in ("/metrics", "/readyz")] == [404, 404]
        for path, bytes_at_most in (
            ("/api/links/a/runs", 64 << 10),
            ("/api/run/ratings/1", 512 << 10),
            ("/api/admin/session", 64 << 10),
            ("/api/admin/invitations/x", 64 << 10),
            ("/api/admin/studies", 16 << 20),
        ):
            assert posted(proxy.port, path, bytes_at_most + 1) == 413, path
            assert posted(proxy.port, path, bytes_at_most) == 201, path
        assert posted(proxy.port, "/api/admin/uploads", 17 << 20) == 201


def test_a_body_reaches_the_server_as_it_comes(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, asked), nginx(program, tmp_path, behind) as proxy:
        head = b"POST /api/run/ratings/1 HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\na"
        with socket.create_connection(("127.0.0.1", proxy.port)) as client:
            client.sendall(head)
            until = time.monotonic() + 10
            while not asked:
                assert time.monotonic() < until, "the server was not asked before the body had come"
                time.sleep(0.02)
            client.sendall(b"b")
            assert b" 201 " in client.recv(200)


def test_a_refused_request_leaves_no_address_in_a_log(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, _), nginx(program, tmp_path, behind) as proxy:
        assert posted(proxy.port, "/api/links/a/runs", (64 << 10) + 1) == 413
    logs = [path.read_text(encoding="utf-8") for path in tmp_path.rglob("*log*") if path.is_file()]
    assert not [text for text in logs if "client:" in text]


def test_an_emptied_cache_is_filled_again(program: str, tmp_path: Path) -> None:
    with upstream() as (behind, asked), nginx(program, tmp_path, behind) as proxy:
        assert answer(proxy.port, ADDRESS) == (200, CLIP)
        kept = [path for path in tmp_path.rglob("*") if path.is_file() and CLIP in path.read_bytes()]
        assert kept
        for path in kept:
            shutil.rmtree(path.parent.parent)
        assert answer(proxy.port, ADDRESS) == (200, CLIP)
        assert len(asked) == 2


def posted(port: int, path: str, size: int) -> int:
    """The status of a POST that says it is so long; its body follows where it is asked for."""
    done = subprocess.run(
        [
            shutil.which("curl") or pytest.skip("curl is not installed here"),
            *("-s", "-o", "/dev/null", "-w", "%{http_code}", "--data-binary", "@-"),
            f"http://127.0.0.1:{port}{path}",
        ],
        input=b"x" * size,
        stdout=subprocess.PIPE,
        check=False,
    )
    return int(done.stdout)


def test_the_file_keeps_no_addresses_and_says_what_was_changed_for_loopback(tmp_path: Path) -> None:
    assert "access_log off;" in TEXT
    assert "error_log /dev/null" in TEXT
    assert "listen 443 ssl" in TEXT
    site = (nginx_configuration(tmp_path, 8123, 8124).parent / "site.conf").read_text(encoding="utf-8")
    assert "server 127.0.0.1:8123;" in site
    assert "listen 127.0.0.1:8124" in site
    assert "ssl" not in site
