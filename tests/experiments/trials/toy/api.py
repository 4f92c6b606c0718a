"""The client that a simulated person speaks through."""

from typing import Any

from fastapi.testclient import TestClient


class Api:
    """Requests to a server within this process; an answer that is no success fails the test."""

    token = ""

    def __init__(self, client: TestClient) -> None:
        self._client = client

    def get(self, path: str) -> Any:
        return self._send("GET", path)

    def put(self, path: str, body: Any = None) -> Any:
        return self._send("PUT", path, body)

    def post(self, path: str, body: Any = None) -> Any:
        return self._send("POST", path, body)

    def _send(self, method: str, path: str, body: Any = None) -> Any:
        headers = {"authorization": f"Bearer {self.token}"} if self.token else {}
        answer = self._client.request(method, path, json=body, headers=headers)
        assert answer.status_code < 300, answer.text
        return answer.json()
