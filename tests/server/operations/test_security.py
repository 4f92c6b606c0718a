"""What docs/explanation/security.md promises: separation of participants, headers, Origin and limits."""

import re
import uuid

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.app import create_app
from server.context import Services
from server.core.settings import Settings
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def test_one_participant_can_neither_read_nor_write_anothers_run(
    client: TestClient, study: StudyInDatabase
) -> None:
    first, second = (
        Participant(client, study.link_token).agree(),
        Participant(client, study.link_token).agree(),
    )
    rating_id = str(uuid.uuid4())
    trial = first.state()["trials"][0]
    assert first.rate(trial, 3, rating_id).status_code == 201
    assert second.state()["trials"][0]["answered"] is False
    # Ids belong to their run: even the same id reaches the second's own trial alone.
    assert second.rate(second.state()["trials"][0], 6, rating_id).status_code == 201
    with study.services.database.read() as session:
        query = "SELECT run, response FROM ratings WHERE trial_index = 0"
        assert dict(map(tuple, session.execute(text(query)))) == {first.run_id: 3, second.run_id: 6}
    for wrong in ("", "x", first.run_id, first.link, first.token[:-1], first.token.swapcase()):
        second.token = wrong
        for method, path in (("GET", ""), ("PUT", "/consent"), ("POST", "/complete"), ("POST", "/withdraw")):
            answer = second.request(method, path, {"agreed": True} if method != "GET" else None)
            assert answer.status_code in (401, 403, 404), (wrong, path, answer.status_code)
        assert second.rate(trial).status_code in (401, 403, 404)


def test_every_answer_carries_the_headers(client: TestClient, study: StudyInDatabase) -> None:
    for path in ("/healthz", "/api/openapi.json", "/nothing", f"/api/links/{study.link_token}", "/admin/"):
        headers = client.get(path).headers
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self';")
        assert "unsafe" not in policy
        assert not re.search(r"https?:", policy)
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-embedder-policy"] == "require-corp"
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "strict-transport-security" not in headers
        assert "server" not in headers


def test_behind_https_browsers_are_told_to_stay_there(settings: Settings) -> None:
    secure = settings.model_copy(update={"public_url": "https://lab.example"})
    with TestClient(create_app(secure)) as client:
        header = client.get("/healthz").headers["strict-transport-security"]
    assert int(header.split("max-age=")[1].split(";")[0]) >= 31536000


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site", "origin": "http://localhost.evil.example"},
    ],
)
def test_a_change_asked_for_by_another_site_is_refused(
    owner: Admin, study: StudyInDatabase, headers: dict[str, str]
) -> None:
    answer = owner.send("POST", "/studies/short/links", {"kind": "general"}, headers=headers)
    assert answer.status_code == 403


def test_run_starts_of_one_link_are_limited(
    settings: Settings, study: StudyInDatabase, services: Services
) -> None:
    with TestClient(create_app(settings.model_copy(update={"run_starts_per_minute": 3}))) as client:
        statuses = [Participant(client, study.link_token).start().status_code for _ in range(5)]
    assert statuses == [201, 201, 201, 429, 429]


def test_links_that_strangers_invent_are_not_counted(
    settings: Settings, study: StudyInDatabase, services: Services
) -> None:
    """Ten thousand of them would push the counts of real links out of a process's memory and the table."""
    with TestClient(create_app(settings.model_copy(update={"run_starts_per_minute": 1}))) as client:
        assert Participant(client, study.link_token).start().status_code == 201
        app_services = client.app.state.services  # type: ignore[attr-defined]
        before = len(app_services.run_starts._buckets), len(app_services.unsupported._buckets)
        for number in range(3):
            assert Participant(client, f"invented{number}").start().status_code == 404
            report = {"link_token": f"invented{number}", "reason": "no_webcodecs", "data": {}}
            assert client.post("/api/unsupported", json=report).status_code == 404
        assert (len(app_services.run_starts._buckets), len(app_services.unsupported._buckets)) == before
        assert Participant(client, study.link_token).start().status_code == 429


def test_sign_ins_from_one_place_are_limited(settings: Settings, owner: Admin) -> None:
    with TestClient(create_app(settings.model_copy(update={"logins_per_minute": 3}))) as client:
        body = {"password": "wrong guess again"}
        answers = [
            client.post("/api/admin/session", json=body | {"name": f"name {number}"}).status_code
            for number in range(5)
        ]
    assert answers == [401, 401, 401, 429, 429]
