"""Every endpoint refuses in the one shape, whatever is wrong, and never with a 5xx."""

import re
from importlib.metadata import version
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services


def assert_shape(answer: Any) -> None:
    assert 400 <= answer.status_code < 500, (answer.request.method, answer.request.url, answer.text[:300])
    error = answer.json()["error"]
    assert set(error) == {"code", "message", "details"}
    assert re.fullmatch(r"[a-z_]+", error["code"])
    assert error["message"]
    assert "Traceback" not in error["message"]


def test_every_endpoint_without_credentials_or_body(client: TestClient, study: Any) -> None:
    schema = client.get("/api/openapi.json").json()
    open_to_all = {"/healthz", "/readyz", "/metrics"}
    for path, operations in schema["paths"].items():
        for method in operations:
            if path in open_to_all or path.startswith("/api/admin"):
                continue
            assert_shape(client.request(method, re.sub(r"\{.*?\}", "nonsense", path)))


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b'{"language": 7}', b"\xff\xfe", b"null"])
def test_bodies_that_are_not_what_was_asked_for(client: TestClient, study: Any, body: bytes) -> None:
    headers = {"content-type": "application/json"}
    assert_shape(client.post(f"/api/links/{study.link_token}/runs", content=body, headers=headers))


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", None]
)
def test_a_body_that_is_not_said_to_be_json_is_refused_with_what_was_expected(
    client: TestClient, study: Any, kind: str | None
) -> None:
    headers = {} if kind is None else {"content-type": kind}
    answer = client.post(f"/api/links/{study.link_token}/runs", content=b"{}", headers=headers)
    assert_shape(answer)
    assert (answer.status_code, answer.json()["error"]["code"]) == (415, "unsupported_media_type")
    assert "application/json" in answer.json()["error"]["message"]


def test_strangers_do_not_see_the_version(client: TestClient) -> None:
    said = client.get("/api/openapi.json").text
    assert version("palpebra") not in said


@pytest.mark.parametrize("path", ["/api/nothing", "/nothing", "/assets/participant/nothing.js"])
def test_addresses_where_nothing_is(client: TestClient, path: str) -> None:
    assert_shape(client.get(path))
    assert_shape(client.delete("/api/run"))


def renamed(services: Services, old: str, new: str) -> None:
    with services.database.engine.begin() as connection:
        connection.exec_driver_sql(f"ALTER TABLE links RENAME COLUMN {old} TO {new}")


def test_a_failure_of_the_server_says_nothing_of_its_inside(client: TestClient, services: Services) -> None:
    renamed(services, "token_hash", "gone")
    try:
        answer = client.get("/api/links/x")
    finally:
        renamed(services, "gone", "token_hash")
    assert answer.status_code == 500
    assert answer.json()["error"] == {
        "code": "internal",
        "message": "The server had an internal error. Please try again.",
        "details": {},
    }


def test_a_body_that_is_too_large(client: TestClient, study: Any) -> None:
    def endless() -> Any:
        for _ in range(20):
            yield b" " * 65536

    url = f"/api/links/{study.link_token}/runs"
    for content in (b" " * 600_000, endless()):
        answer = client.post(url, content=content)
        assert (answer.status_code, answer.json()["error"]["code"]) == (413, "too_large")
