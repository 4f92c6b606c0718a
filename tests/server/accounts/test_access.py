import pytest
from fastapi.testclient import TestClient

from server.accounts.identity import OPERATOR
from server.context import Services
from server.core.settings import Settings
from server.models import Job
from server.studies.lookup import find_study
from tests.helpers.admins import Admin, fresh_browser, signed_in
from tests.helpers.studies import SHORT, StudyInDatabase

CHANGES = [
    ("POST", "/studies", {}),
    ("DELETE", "/studies/short", None),
    ("POST", "/studies/short/versions", {"revision": 1, "toml": SHORT}),
    ("PUT", "/studies/short/status", {"revision": 1, "status": "live"}),
    ("PUT", "/studies/short/settings", {"revision": 1, "paused": True, "quota": None, "recruiter": None}),
    ("POST", "/studies/short/links", {"kind": "general"}),
    ("PUT", "/studies/short/runs/x/exclusion", {"reason": "slept"}),
    ("POST", "/studies/short/runs/x/erase", {"confirm": "x"}),
    ("POST", "/studies/short/reports", {}),
]
OWNERS = [("GET", "/accounts"), ("POST", "/invitations"), ("GET", "/audit"), ("PATCH", "/accounts/1")]


def by_token(client: TestClient, settings: Settings, admin: Admin, *scopes: str) -> TestClient:
    token = admin.send("POST", "/tokens", {"name": "script", "scopes": list(scopes)}).json()["token"]
    script = fresh_browser(client, settings)
    script.headers["authorization"] = f"Bearer {token}"
    return script


@pytest.mark.parametrize(("method", "path", "body"), CHANGES)
def test_viewers_cannot_change(
    viewer: Admin, study: StudyInDatabase, method: str, path: str, body: dict[str, object] | None
) -> None:
    answer = viewer.send(method, path, body)
    assert (answer.status_code, answer.json()["error"]["code"]) == (403, "not_allowed")


@pytest.mark.parametrize(("method", "path"), OWNERS)
def test_experimenters_cannot_manage_people(experimenter: Admin, method: str, path: str) -> None:
    assert experimenter.send(method, path, {}).status_code == 403


@pytest.mark.parametrize(("method", "path"), [("GET", "/studies"), *(one[:2] for one in CHANGES), *OWNERS])
def test_nobody_gets_in_without_signing_in(
    client: TestClient, study: StudyInDatabase, method: str, path: str
) -> None:
    answer = client.request(method, f"/api/admin{path}", json={})
    assert (answer.status_code, answer.json()["error"]["code"]) == (401, "not_signed_in")


def test_a_token_cannot_exceed_its_scopes(
    client: TestClient, settings: Settings, owner: Admin, study: StudyInDatabase
) -> None:
    reads, exports = by_token(client, settings, owner, "read"), by_token(client, settings, owner, "export")
    assert reads.get("/api/admin/studies").status_code == 200
    assert reads.get("/api/admin/studies/short/data/ratings.csv").status_code == 403
    assert reads.post("/api/admin/studies/short/links", json={"kind": "general"}).status_code == 403
    assert exports.get("/api/admin/studies").status_code == 403
    assert exports.get("/api/admin/studies/short/data/ratings.csv").status_code == 200
    for script in (reads, exports, by_token(client, settings, owner, "read", "write", "export")):
        assert script.get("/api/admin/accounts").status_code == 403
        assert script.post("/api/admin/tokens", json={"name": "more", "scopes": ["write"]}).status_code == 403


def test_files_of_reports_hold_persons_and_need_a_token_for_them(
    client: TestClient, settings: Settings, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    with services.database.write() as session:
        found = find_study(session, study.name, OPERATOR, "view")
        session.add(Job(public_id="f" * 32, kind="report", study_id=found.id, status="done", message=""))
    folder = services.settings.data_folder / "reports" / ("f" * 32)
    folder.mkdir(parents=True)
    (folder / "cell-means.csv").write_text("participant,mean\n")
    reports = "/api/admin/studies/short/reports"
    file = f"{reports}/{'f' * 32}/cell-means.csv"
    reads = by_token(client, settings, owner, "read", "write")
    assert reads.get(reports).json()[0]["files"] == ["cell-means.csv"]
    refused = reads.get(file)
    assert (refused.status_code, "'export' or 'personal'" in refused.text) == (403, True)
    assert "participant" not in refused.text
    for scope in ("export", "personal"):
        assert by_token(client, settings, owner, scope).get(file).text == "participant,mean\n"
    assert owner.get(f"/studies/short/reports/{'f' * 32}/cell-means.csv").status_code == 200


def test_a_viewers_token_cannot_write(
    client: TestClient, settings: Settings, viewer: Admin, study: StudyInDatabase
) -> None:
    script = by_token(client, settings, viewer, "read", "write", "export")
    assert script.post("/api/admin/studies/short/links", json={"kind": "general"}).status_code == 403


def test_one_owner_must_remain(owner: Admin) -> None:
    me = owner.get("/session").json()["account"]["id"]
    assert owner.send("PATCH", f"/accounts/{me}", {"role": "viewer"}).status_code == 409


def test_a_disabled_account_is_out_at_once(client: TestClient, services: Services, owner: Admin) -> None:
    other = signed_in(client, services, "experimenter")
    other_id = other.get("/session").json()["account"]["id"]
    assert owner.send("PATCH", f"/accounts/{other_id}", {"disabled": True}).status_code == 200
    assert other.get("/studies").status_code == 401


def test_changes_are_in_the_audit_log(owner: Admin, study: StudyInDatabase) -> None:
    owner.send("POST", "/studies/short/links", {"kind": "general", "label": "lab"})
    [entry] = [row for row in owner.get("/audit").json() if row["action"] == "links made"]
    assert (entry["actor"], entry["target"], entry["details"]["number"]) == (owner.name, "short", 1)
