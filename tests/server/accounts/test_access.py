import pytest
from fastapi.testclient import TestClient

from server.app import create_app
from server.settings import Settings
from tests.helpers.admins import Admin, signed_in
from tests.helpers.studies import StudyInDatabase

CHANGES = [
    ("POST", "/studies"),
    ("DELETE", "/studies/short"),
    ("POST", "/studies/short/versions"),
    ("PUT", "/studies/short/texts"),
    ("PUT", "/studies/short/status"),
    ("PUT", "/studies/short/settings"),
    ("POST", "/studies/short/links"),
    ("PUT", "/studies/short/runs/x/exclusion"),
    ("POST", "/studies/short/runs/x/erase"),
    ("POST", "/studies/short/reports"),
]
OWNERS = [("GET", "/accounts"), ("POST", "/invitations"), ("GET", "/audit"), ("PATCH", "/accounts/1")]


def by_token(settings: Settings, admin: Admin, *scopes: str) -> TestClient:
    token = admin.send("POST", "/tokens", {"name": "script", "scopes": list(scopes)}).json()["token"]
    client = TestClient(create_app(settings), base_url=settings.public_url, raise_server_exceptions=False)
    client.headers["authorization"] = f"Bearer {token}"
    return client


@pytest.mark.parametrize(("method", "path"), CHANGES)
def test_viewers_cannot_change(viewer: Admin, study: StudyInDatabase, method: str, path: str) -> None:
    answer = viewer.send(method, path, {})
    assert (answer.status_code, answer.json()["error"]["code"]) == (403, "not_allowed")


@pytest.mark.parametrize(("method", "path"), OWNERS)
def test_experimenters_cannot_manage_people(experimenter: Admin, method: str, path: str) -> None:
    assert experimenter.send(method, path, {}).status_code == 403


@pytest.mark.parametrize(("method", "path"), [("GET", "/studies"), *CHANGES, *OWNERS])
def test_nobody_gets_in_without_signing_in(
    client: TestClient, study: StudyInDatabase, method: str, path: str
) -> None:
    answer = client.request(method, f"/api/admin{path}", json={})
    assert (answer.status_code, answer.json()["error"]["code"]) == (401, "not_signed_in")


def test_a_token_cannot_exceed_its_scopes(settings: Settings, owner: Admin, study: StudyInDatabase) -> None:
    reads, exports = by_token(settings, owner, "read"), by_token(settings, owner, "export")
    assert reads.get("/api/admin/studies").status_code == 200
    assert reads.get("/api/admin/studies/short/data/ratings.csv").status_code == 403
    assert reads.post("/api/admin/studies/short/links", json={"kind": "general"}).status_code == 403
    assert exports.get("/api/admin/studies").status_code == 403
    assert exports.get("/api/admin/studies/short/data/ratings.csv").status_code == 200
    for client in (reads, exports, by_token(settings, owner, "read", "write", "export")):
        assert client.get("/api/admin/accounts").status_code == 403
        assert client.post("/api/admin/tokens", json={"name": "more", "scopes": ["write"]}).status_code == 403


def test_a_viewers_token_cannot_write(settings: Settings, viewer: Admin, study: StudyInDatabase) -> None:
    client = by_token(settings, viewer, "read", "write", "export")
    assert client.post("/api/admin/studies/short/links", json={"kind": "general"}).status_code == 403


def test_one_owner_must_remain(settings: Settings, owner: Admin) -> None:
    me = owner.get("/session").json()["account"]["id"]
    assert owner.send("PATCH", f"/accounts/{me}", {"role": "viewer"}).status_code == 409


def test_a_disabled_account_is_out_at_once(settings: Settings, services, owner: Admin) -> None:  # type: ignore[no-untyped-def]
    other = signed_in(settings, services, "experimenter")
    other_id = other.get("/session").json()["account"]["id"]
    assert owner.send("PATCH", f"/accounts/{other_id}", {"disabled": True}).status_code == 200
    assert other.get("/studies").status_code == 401


def test_changes_are_in_the_audit_log(owner: Admin, study: StudyInDatabase) -> None:
    owner.send("POST", "/studies/short/links", {"kind": "general", "label": "lab"})
    [entry] = [row for row in owner.get("/audit").json() if row["action"] == "links made"]
    assert (entry["actor"], entry["target"], entry["details"]["number"]) == (owner.name, "short", 1)
