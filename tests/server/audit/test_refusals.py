"""Who tries what is not hers is written down, and cannot fill the log by it."""

from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.accounts.access import COOKIE
from server.context import REFUSALS_PER_MINUTE, Services
from server.core.limits import BoundedRecords
from server.core.settings import Settings
from tests.helpers.admins import Admin, fresh_browser
from tests.helpers.studies import StudyInDatabase


def refused(owner: Admin) -> list[dict[str, Any]]:
    return [row for row in owner.get("/audit").json() if row["action"] == "refused"]


def test_a_wrong_present_password_is_written_down(owner: Admin) -> None:
    body = {"password": "not this one", "new_password": "another long one"}
    assert owner.send("PUT", "/password", body).status_code == 401
    [row] = refused(owner)
    assert (row["actor"], row["target"]) == (owner.name, "PUT /api/admin/password")
    assert row["details"] == {"code": "wrong_credentials", "status": 401}


def test_rights_and_studies_of_others_are_written_down(
    owner: Admin, viewer: Admin, study: StudyInDatabase
) -> None:
    assert viewer.get("/accounts").status_code == 403
    assert viewer.send("DELETE", "/studies/short").status_code == 403
    assert viewer.get("/studies/hidden").status_code == 404
    rows = refused(owner)
    assert {row["actor"] for row in rows} == {viewer.name}
    assert [(row["target_kind"], row["target"], row["details"]["status"]) for row in rows] == [
        ("study", "hidden", 404),
        ("study", "short", 403),
        ("route", "GET /api/admin/accounts", 403),
    ]


@pytest.mark.parametrize("kind", ["token", "cookie"])
def test_invented_tokens_are_written_down_and_cannot_fill_the_log(
    client: TestClient, settings: Settings, owner: Admin, kind: str
) -> None:
    stranger = fresh_browser(client, settings)
    if kind == "token":
        stranger.headers["authorization"] = "Bearer invented"
    else:
        stranger.cookies.set(COOKIE, "invented", path="/api/admin")
    for _ in range(2 * REFUSALS_PER_MINUTE):
        assert stranger.get("/api/admin/studies").status_code == 401
    rows = refused(owner)
    assert 1 <= len(rows) <= 4
    assert {row["actor"] for row in rows} == {"nobody"}


def test_what_is_not_a_try_is_not_written_down(
    client: TestClient, settings: Settings, owner: Admin, study: StudyInDatabase
) -> None:
    assert fresh_browser(client, settings).get("/api/admin/studies").status_code == 401
    assert owner.get("/studies/short/runs/0000").status_code == 404
    assert refused(owner) == []


def test_what_was_not_written_is_counted_with_the_next() -> None:
    records = BoundedRecords(20, 3)
    assert [records.written("a") for _ in range(5)] == [0, 0, 0, None, None]
    assert records.written("b") == 2
    others = [records.written(str(number)) for number in range(30)]
    assert others.count(None) >= 30 - 17


def test_a_stranger_uses_up_no_room_of_those_who_are_known(
    client: TestClient, settings: Settings, owner: Admin, viewer: Admin
) -> None:
    stranger = fresh_browser(client, settings)
    stranger.headers["authorization"] = "Bearer invented"
    for number in range(2 * REFUSALS_PER_MINUTE):
        stranger.request("GET" if number % 2 else "DELETE", f"/api/admin/studies/x{number // 8}")
    for path in ("/studies", "/me", "/tokens", "/sessions", "/workspaces", "/audit", "/accounts"):
        for _ in range(3):
            stranger.get(f"/api/admin{path}")
    assert viewer.get("/accounts").status_code == 403
    assert [row["actor"] for row in refused(owner)].count(viewer.name) == 1


@pytest.mark.parametrize("end", ["revoked", "expired"])
def test_a_token_that_has_ended_is_not_a_stranger(
    services: Services, client: TestClient, settings: Settings, owner: Admin, end: str
) -> None:
    made = owner.send("POST", "/tokens", {"name": "night", "scopes": ["read"]}).json()
    column = {"revoked": "revoked_at", "expired": "expires_at"}[end]
    with services.database.write() as session:
        session.execute(text(f"UPDATE api_tokens SET {column} = created_at"))
    script = fresh_browser(client, settings)
    script.headers["authorization"] = f"Bearer {made['token']}"
    answer = script.get("/api/admin/studies")
    assert (answer.status_code, answer.json()["error"]["code"]) == (401, "not_signed_in")
    assert refused(owner) == []


def test_a_refusal_is_answered_where_it_cannot_be_written(
    services: Services, viewer: Admin, caplog: pytest.LogCaptureFixture
) -> None:
    with services.database.write() as session:
        session.execute(text("ALTER TABLE audit_entries RENAME TO away"))
    try:
        assert viewer.get("/accounts").status_code == 403
    finally:
        with services.database.write() as session:
            session.execute(text("ALTER TABLE away RENAME TO audit_entries"))
    assert "a refusal could not be written to the audit log" in caplog.text


def test_a_nul_in_a_path_is_refused_before_anybody_is_recognised(
    client: TestClient, settings: Settings, owner: Admin
) -> None:
    stranger = fresh_browser(client, settings)
    stranger.headers["authorization"] = "Bearer invented"
    assert stranger.get("/api/admin/studies/a%00b").status_code == 422
    assert refused(owner) == []
