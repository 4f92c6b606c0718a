"""Bodies of strangers are small, uploads are read only from known senders, and who stalls is cut off."""

import http.client
import json
import socket
import time
import urllib.request
from collections.abc import Iterator
from contextlib import suppress

import pytest

from server import protocol, request_limits
from server.app import create_app
from server.context import Services
from server.rehearsals.http import running_server
from tests.helpers.attacked import Attacked, api_token
from tests.helpers.studies import StudyInDatabase

pytestmark = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
ANSWERS = 60
PIECE = b" " * (1 << 20)
ANONYMOUS = (
    "/api/admin/session",
    "/api/admin/invitations/x/account",
    "/api/unsupported",
    "/api/links/x/runs",
)


def send_large(port: int, path: str, size: int, content_type: str, token: str = "") -> tuple[int, int]:
    """Send a chunked body of `size` mebibytes; return the status and how many were taken."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.putrequest("POST", path)
    connection.putheader("content-type", content_type)
    connection.putheader("transfer-encoding", "chunked")
    if token:
        connection.putheader("authorization", f"Bearer {token}")
    connection.endheaders()
    sent = 0
    try:
        while sent < size:
            connection.send(b"%x\r\n%s\r\n" % (len(PIECE), PIECE))
            sent += 1
        connection.send(b"0\r\n\r\n")
    except OSError:
        pass
    try:
        return connection.getresponse().status, sent
    except OSError:  # the connection was closed while we were still sending
        return 0, sent
    finally:
        connection.close()


def test_strangers_cannot_fill_memory_or_disk(attacked: Attacked, services: Services) -> None:
    before = attacked.memory_mb()
    form = "multipart/form-data; boundary=x"
    kinds = [*((path, "application/json") for path in ANONYMOUS), ("/api/admin/uploads", form)]
    kinds += [("/api/admin/definitions/check", "application/json")]
    for path, content_type in kinds:
        for token in ("", "guessed"):
            status, sent = send_large(attacked.port, path, 100, content_type, token)
            assert status in (0, 401, 413), (path, status)
            assert sent < 20, (path, sent)
    assert attacked.memory_mb() - before < 40
    folder = services.settings.upload_folder
    assert not folder.exists() or list(folder.iterdir()) == []


@pytest.fixture
def port(services: Services, study: StudyInDatabase) -> Iterator[int]:
    """Of a server in this process."""
    with running_server(create_app(services.settings)) as url:
        yield int(url.rsplit(":", 1)[1])


def test_an_account_may_send_more_than_a_stranger(port: int, services: Services) -> None:
    token = api_token(services, "read", "write")
    body = json.dumps({"toml": "# " + "x" * 200_000}).encode()
    for bearer, status in ((token, 200), ("guessed", 401)):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        headers = {"content-type": "application/json", "authorization": f"Bearer {bearer}"}
        connection.request("POST", "/api/admin/definitions/check", body, headers)
        assert connection.getresponse().status == status
        connection.close()
    token = api_token(services, "read", name="reader")  # may not upload, and is told so before it has sent it
    assert send_large(port, "/api/admin/uploads", 50, "multipart/form-data; boundary=x", token)[1] < 20


def is_ended(connection: socket.socket, drip: bytes = b"x") -> bool:
    """Whether the server ends the connection of a client that sends a byte now and then."""
    began = time.monotonic()
    connection.settimeout(0.05)
    while time.monotonic() - began < 60:
        try:
            connection.send(drip)
            if connection.recv(65536) == b"":
                return True
        except TimeoutError:
            continue
        except OSError:
            return True
    return False


HALF_SENT = [
    b"",
    b"GET /healthz HTTP/1.1\r\nhost: x\r\nx-slow: ",
    b"POST /api/unsupported HTTP/1.1\r\nhost: x\r\ncontent-length: 900\r\n\r\n{",
]


def test_half_sent_requests_are_cut(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "HEAD_S", 0.4)
    monkeypatch.setattr(request_limits, "BODY_S", 0.4)
    for half in HALF_SENT:
        with socket.create_connection(("127.0.0.1", port)) as connection:
            connection.sendall(half)
            assert is_ended(connection, drip=b"x" if half else b""), half


def test_a_head_without_end_is_cut(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nx: ")
        sent = 0
        try:
            while sent < 200:
                connection.sendall(b"x" * 65536)
                sent += 1
        except OSError:
            pass
    assert sent < 100


def test_an_answer_nobody_takes_ends_the_connection(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/openapi.json") as answer:
        size = len(answer.read())
    monkeypatch.setattr(protocol, "SEND_S", 0.3)
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", port))
        connection.sendall(b"GET /api/openapi.json HTTP/1.1\r\nhost: x\r\n\r\n" * ANSWERS)
        time.sleep(1.5)
        connection.settimeout(5)
        received = 0
        with suppress(ConnectionResetError):
            while piece := connection.recv(65536):  # without a deadline all of it would come, then silence
                received += len(piece)
    assert 0 < received < ANSWERS * size / 2
