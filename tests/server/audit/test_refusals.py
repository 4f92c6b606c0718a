"""Who tries what is not hers is written down, and cannot fill the log by it."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.accounts.identity import COOKIE
from server.context import REFUSALS_PER_MINUTE
from server.rate_limit import BoundedRecords
from server.settings import Settings
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
