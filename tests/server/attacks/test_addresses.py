"""Addresses and headers that no page sends: each is refused in a line, and none is an unforeseen error."""

import re

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from server.context import Services
from server.core.limits import OpenStreams
from server.models import Clip
from tests.helpers.admins import Admin, signed_in
from tests.helpers.studies import StudyInDatabase

DIGITS = "9" * 5000
"""More than Python makes a number of."""
NAMES = ("%00", "x" * 3000, "..%2f..%2fx", "%252e%252e", "%F0%9F%98%80", DIGITS)


def unforeseen(client: TestClient, addresses: list[str]) -> list[str]:
    """The addresses answered with an error of the server's own; 503 is a page that is not built."""
    return [one[:200] for one in addresses if client.get(one).status_code not in (*range(200, 500), 503)]


def readable(client: TestClient) -> dict[str, list[str]]:
    """Path -> the names of its query's parameters, of every GET but streams."""
    paths = client.app.openapi()["paths"]  # type: ignore[attr-defined]
    return {
        path: [one["name"] for one in methods["get"].get("parameters", ()) if one["in"] == "query"]
        for path, methods in paths.items()
        if "get" in methods and not path.endswith("/stream")
    }


@pytest.mark.parametrize("name", NAMES, ids=lambda name: name[:12])
def test_a_name_that_nothing_has_is_refused(
    client: TestClient, services: Services, study: StudyInDatabase, name: str
) -> None:
    signed_in(client, services, "owner")
    addresses = [f"/assets/admin/{name}", f"/assets/{name}/x", f"/run/{name}", f"/admin/{name}"]
    for path, asked in readable(client).items():
        own = path.replace("{study}", "short")
        for address in {re.sub(r"\{[^}]+\}", name, path), re.sub(r"\{[^}]+\}", name, own)}:
            addresses += [address, *(f"{address}?{one}={name}" for one in asked)]
    assert unforeseen(client, addresses) == []


@pytest.mark.parametrize("asked", [f"bytes={DIGITS}-", f"bytes=-{DIGITS}", f"bytes=0-{DIGITS}"])
def test_a_part_of_a_clip_that_is_not_a_number_is_the_whole_clip(
    client: TestClient, study: StudyInDatabase, asked: str
) -> None:
    with study.services.database.read() as session:
        sha256 = session.scalars(select(Clip.sha256)).first()
    answer = client.get(f"/clips/{sha256}.mp4", headers={"range": asked})
    assert answer.status_code == 200
    assert len(answer.content) == int(answer.headers["content-length"])


@pytest.mark.parametrize(
    "origin", ["http://[", "null", "http://evil.example", "http://localhost@evil.example"]
)
def test_an_origin_that_is_not_an_address_is_another_site(experimenter: Admin, origin: str) -> None:
    answer = experimenter.client.post(
        "/api/admin/tokens",
        json={"name": "x", "scopes": ["read"], "days": 1},
        headers={"origin": origin},
    )
    assert answer.status_code == 403


def test_streams_of_an_account_are_bounded(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    viewer = signed_in(client, services, "viewer")
    stream = "/studies/short/monitor/stream"
    object.__setattr__(services, "streams", OpenStreams(2))
    services.settings.monitor_stream_minutes = 0
    account = viewer.get("/session").json()["account"]["id"]
    with services.streams.one(account) as first, services.streams.one(account) as second:
        assert (first, second) == (True, True)
        refused = viewer.get(stream)
        assert (refused.status_code, refused.json()["error"]["code"]) == (429, "too_many_requests")
        with services.streams.one(account) as third:  # asked for at the same moment
            assert not third
        with services.streams.one(account + 1) as others:
            assert others
    assert viewer.get(stream).text.count("event: monitor") == 1


def test_streams_of_all_accounts_together_are_bounded(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    viewer = signed_in(client, services, "viewer")
    object.__setattr__(services, "streams", OpenStreams(2, overall=3))
    services.settings.monitor_stream_minutes = 0
    account = viewer.get("/session").json()["account"]["id"]
    others = [services.streams.one(account + number) for number in (1, 1, 2)]
    with others[0], others[1], others[2]:
        refused = viewer.get("/studies/short/monitor/stream")
        assert (refused.status_code, refused.json()["error"]["code"]) == (429, "too_many_requests")
        assert "are in use" in refused.json()["error"]["message"]
        with services.streams.one(account) as at_once:
            assert not at_once
    assert viewer.get("/studies/short/monitor/stream").text.count("event: monitor") == 1


def test_heads_that_are_slow_to_read_are_refused(client: TestClient) -> None:
    for method in ("GET", "POST"):
        long = client.request(method, "/api/run?" + "a=1&" * 2049)
        assert (long.status_code, long.json()["error"]["code"]) == (414, "address_too_long")
        many = client.request(method, "/readyz", headers={f"x-{number}": "a" for number in range(201)})
        assert (many.status_code, many.json()["error"]["code"]) == (431, "too_many_headers")
    assert client.get("/readyz?" + "a=1&" * 2000).status_code == 200
