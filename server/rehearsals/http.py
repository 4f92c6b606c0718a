"""A small JSON client on one kept-alive connection, and a server of this process to talk to."""

import http.client
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol
from urllib.parse import urlsplit

import uvicorn
from fastapi import FastAPI

from experiments.errors import InputError
from server.protocol import BoundedHttp

TIMEOUT_S = 60.0
START_TIMEOUT_S = 30.0


class RefusedRequest(Exception):
    """The server answered with a status of 400 or above, in its one error shape."""

    def __init__(self, status: int, body: Any) -> None:
        error = body.get("error", {}) if isinstance(body, dict) else {}
        super().__init__(f"{status} {error.get('code', '')}: {error.get('message', body)}")
        self.status = status
        self.code = str(error.get("code", ""))
        self.details: dict[str, Any] = error.get("details", {})


class RunApi(Protocol):
    """What a simulated person asks of a connection: requests of a participant, with the token of the run."""

    token: str | None

    def get(self, path: str, /) -> Any:
        """The answer to GET."""

    def put(self, path: str, body: Any, /) -> Any:
        """The answer to PUT."""

    def post(self, path: str, body: Any = None, /) -> Any:
        """The answer to POST."""


class JsonClient:
    """Requests to one server, with the run token once there is one."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        if not parts.hostname or parts.scheme not in ("http", "https"):
            raise InputError(f"expected a URL such as http://localhost:8000, got '{url}'")
        self._connection = kind(parts.hostname, parts.port, timeout=TIMEOUT_S)
        self.token: str | None = None
        self.headers: dict[str, str] = {}

    def call(self, method: str, path: str, body: Any = None) -> tuple[int, Any]:
        """Status and decoded answer; RefusedRequest for a status of 400 or above."""
        self.send(method, path, body)
        answer = self._connection.getresponse()
        content = answer.read()
        decoded = json.loads(content) if content else None
        if answer.status >= 400:
            raise RefusedRequest(answer.status, decoded)
        return answer.status, decoded

    def fetch(self, path: str) -> bytes:
        """The bytes of a file; RefusedRequest for a status of 400 or above."""
        self._connection.request("GET", path)
        answer = self._connection.getresponse()
        content = answer.read()
        if answer.status >= 400:
            raise RefusedRequest(answer.status, None)
        return content

    def send(self, method: str, path: str, body: Any = None) -> None:
        """Send a request without waiting for the answer."""
        headers = {"accept": "application/json", "content-type": "application/json", **self.headers}
        if self.token:
            headers["authorization"] = f"Bearer {self.token}"
        text = json.dumps(body) if body is not None else None
        self._connection.request(method, path, text, headers)

    def get(self, path: str) -> Any:
        """The answer to GET."""
        return self.call("GET", path)[1]

    def put(self, path: str, body: Any) -> Any:
        """The answer to PUT."""
        return self.call("PUT", path, body)[1]

    def post(self, path: str, body: Any = None) -> Any:
        """The answer to POST."""
        return self.call("POST", path, body)[1]

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


@contextmanager
def running_server(app: FastAPI) -> Iterator[str]:
    """Serve `app` from a thread on a free port; yields its address."""
    config = uvicorn.Config(
        app, host="127.0.0.1", port=0, log_level="error", access_log=False, http=BoundedHttp
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, name="palpebra-server", daemon=True)
    thread.start()
    try:
        deadline = time.monotonic() + START_TIMEOUT_S
        while not server.started:
            if time.monotonic() > deadline or not thread.is_alive():
                raise InputError("the server did not start; run `server run` to see why")
            time.sleep(0.01)
        port = server.servers[0].sockets[0].getsockname()[1]
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(START_TIMEOUT_S)
