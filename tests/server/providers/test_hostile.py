"""Providers whose answers have no end, or not the form of any: over real HTTP, each is refused in a line."""

import contextlib
import gzip
import json
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

from server.accounts import provider_protocol
from server.accounts.provider_protocol import NotRecognised, ProviderAway, ProviderClient, Secrets
from server.core.errors import ApiError
from server.core.settings import Provider
from tests.helpers.waiting import run_in_own_loop

SECRETS = Secrets("a-state", "a-nonce", "a-verifier-" * 5)
Answer = Callable[[BaseHTTPRequestHandler], None]


def content(value: Any, encoding: str | None = None) -> Answer:
    """The value as JSON, or bytes as they are."""
    told = value if isinstance(value, bytes) else json.dumps(value).encode()

    def answer(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        if encoding:
            handler.send_header("content-encoding", encoding)
        handler.end_headers()
        handler.wfile.write(told)

    return answer


def endless(handler: BaseHTTPRequestHandler) -> None:
    """`{"a": "xxxx...`, until nobody reads any more."""
    handler.send_response(200)
    handler.end_headers()
    handler.wfile.write(b'{"a": "')
    with contextlib.suppress(OSError):
        for _ in range(4_096):
            handler.wfile.write(b"x" * 65_536)


def slow(handler: BaseHTTPRequestHandler) -> None:
    """A byte now and then: no single wait is long."""
    handler.send_response(200)
    handler.end_headers()
    stop: threading.Event = handler.server.stop  # type: ignore[attr-defined]
    with contextlib.suppress(OSError):
        while not stop.wait(0.05):
            handler.wfile.write(b" ")
            handler.wfile.flush()


def elsewhere(handler: BaseHTTPRequestHandler) -> None:
    handler.send_response(302)
    handler.send_header("location", "http://127.0.0.1:9/secrets")
    handler.end_headers()


class Hostile(ThreadingHTTPServer):
    """Answers each path as configured; an honest description by default."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self.server_port}"
        self.answers: dict[str, Answer] = {}
        self.stop = threading.Event()

    def described(self, **changes: Any) -> dict[str, Any]:
        names = {
            f"{name}_endpoint": f"{self.address}/{name}" for name in ("authorization", "token", "userinfo")
        }
        return {"issuer": self.address, "jwks_uri": f"{self.address}/keys", **names, **changes}


class Handler(BaseHTTPRequestHandler):
    server: Hostile

    def do_GET(self) -> None:
        default = content(self.server.described())
        self.server.answers.get(self.path.strip("/"), default)(self)

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["content-length"]))
        self.do_GET()

    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def hostile() -> Iterator[Hostile]:
    with Hostile() as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.stop.set()
        server.shutdown()
        thread.join()


@pytest.fixture
def client(hostile: Hostile, monkeypatch: pytest.MonkeyPatch) -> ProviderClient:
    monkeypatch.setattr(provider_protocol, "WHOLE_S", 1.0)
    provider = Provider(label="Hostile", issuer=hostile.address, client_id="palpebra")
    return ProviderClient(provider, "http://localhost:8000/callback")


DESCRIPTION = ".well-known/openid-configuration"
BOMB = gzip.compress(b" " * 50_000_000)
ANSWERS = {
    "endless": endless,
    "slow": slow,
    "elsewhere": elsewhere,
    "bomb": content(BOMB, "gzip"),
    "deep": content(b"[" * 100_000),
    "list": content([1]),
    "no text": content(b"\xff\xfe"),
}
KEYS = [{"keys": 5}, {"keys": [{"kty": "RSA"}]}, {"keys": [{"kty": "RSA", "n": 5, "e": 1}]}]


@pytest.mark.parametrize("answer", ANSWERS.values(), ids=ANSWERS)
@pytest.mark.parametrize("path", [DESCRIPTION, "token", "keys"])
def test_an_answer_without_end_or_form_is_refused(
    hostile: Hostile, client: ProviderClient, path: str, answer: Answer
) -> None:
    hostile.answers |= {"token": content({"id_token": "a.b.c", "token_type": "bearer", "access_token": "x"})}
    hostile.answers[path] = answer
    with pytest.raises((ProviderAway, NotRecognised)) as refused:
        run_in_own_loop(client.recognise("a-code", None, SECRETS))
    assert refused.value.status in (401, 503)


@pytest.mark.parametrize(
    "changes",
    [
        {"token_endpoint": 5},
        {"jwks_uri": ["http://localhost/keys"]},
        {"authorization_endpoint": None},
        {"token_endpoint_auth_methods_supported": 7},
        {"id_token_signing_alg_values_supported": {"RS256": True}},
        {"id_token_signing_alg_values_supported": [[]]},
        {"authorization_endpoint": "https://[broken"},
        {"userinfo_endpoint": "https://[broken"},
    ],
    ids=str,
)
def test_a_description_of_another_form_is_refused(
    hostile: Hostile, client: ProviderClient, changes: dict[str, Any]
) -> None:
    hostile.answers[DESCRIPTION] = content(hostile.described(**changes))
    with pytest.raises(ProviderAway):
        run_in_own_loop(client.authorization_url(SECRETS))


@pytest.mark.parametrize(
    "token",
    [[], 5, "x", {}, {"id_token": 5}, {"id_token": "a.b.c", "expires_in": "soon"}, {"error": ["x"]}, None],
    ids=str,
)
@pytest.mark.parametrize("keys", KEYS, ids=str)
def test_tokens_and_keys_of_another_form_sign_nobody_in(
    hostile: Hostile, client: ProviderClient, token: Any, keys: Any
) -> None:
    hostile.answers |= {"token": content(token), "keys": content(keys)}
    with pytest.raises(ApiError) as refused:
        run_in_own_loop(client.recognise("a-code", None, SECRETS))
    assert refused.value.status in (401, 503)
