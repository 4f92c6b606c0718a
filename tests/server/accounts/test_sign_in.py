import pyotp
import pytest
from fastapi.testclient import TestClient

from server.accounts import invitations
from server.accounts.access import COOKIE
from server.context import Services
from server.core.settings import Settings
from server.models import Account, AdminSession, ApiToken, Invitation
from tests.helpers.admins import PASSWORD, Admin, fresh_browser


def test_a_one_time_link_works_once(client: TestClient, settings: Settings, services: Services) -> None:
    _, token = invitations.invite(services.database, "owner", "first", None)
    browser = fresh_browser(client, settings)
    nobody = {"account": None, "workspaces": [], "accounts_exist": False}
    assert browser.get("/api/admin/session").json() == nobody
    body = {"name": "ada", "password": PASSWORD}
    assert browser.post(f"/api/admin/invitations/{token}/account", json=body).status_code == 201
    assert browser.get("/api/admin/session").json()["account"]["role"] == "owner"
    again = browser.post(f"/api/admin/invitations/{token}/account", json=body | {"name": "eve"})
    assert (again.status_code, again.json()["error"]["code"]) == (409, "conflict")


@pytest.mark.parametrize("password", ["short", "a" * 20, "1234567890ab"])
def test_a_weak_password_is_refused(
    client: TestClient, settings: Settings, services: Services, password: str
) -> None:
    _, token = invitations.invite(services.database, "owner", "", None)
    answer = fresh_browser(client, settings).post(
        f"/api/admin/invitations/{token}/account", json={"name": "ada", "password": password}
    )
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "weak_password")


def test_secrets_are_stored_hashed(services: Services, owner: Admin) -> None:
    token = owner.send("POST", "/tokens", {"name": "script", "scopes": ["read"]}).json()["token"]
    cookie = owner.client.cookies[COOKIE]
    with services.database.read() as session:
        stored = [
            *(row.password_hash for row in session.query(Account)),
            *(row.token_hash for row in session.query(AdminSession)),
            *(row.token_hash for row in session.query(ApiToken)),
            *(row.token_hash for row in session.query(Invitation)),
        ]
    assert not [text for text in stored if PASSWORD in text or token in text or cookie in text]


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites(
    client: TestClient, settings: Settings, services: Services
) -> None:
    _, token = invitations.invite(services.database, "owner", "", None)
    made = fresh_browser(client, settings).post(
        f"/api/admin/invitations/{token}/account", json={"name": "ada", "password": PASSWORD}
    )
    cookie = made.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


def test_an_unknown_name_and_a_wrong_password_get_the_same_answer(
    client: TestClient, settings: Settings, owner: Admin
) -> None:
    browser = fresh_browser(client, settings)
    one = browser.post("/api/admin/session", json={"name": owner.name, "password": "wrong"})
    two = browser.post("/api/admin/session", json={"name": "nobody", "password": "wrong"})
    assert one.json() == two.json()


def test_second_factor_and_recovery_codes(client: TestClient, settings: Settings, owner: Admin) -> None:
    setup = owner.send("POST", "/second-factor").json()
    assert setup["qr_svg"].startswith("<?xml")
    code = pyotp.TOTP(setup["secret"]).now()
    recovery = owner.send("PUT", "/second-factor", {"code": code}).json()["codes"]
    credentials = {"name": owner.name, "password": PASSWORD}
    browser = fresh_browser(client, settings)
    missing = browser.post("/api/admin/session", json=credentials)
    assert missing.json()["error"]["code"] == "second_factor_required"
    replayed = browser.post("/api/admin/session", json=credentials | {"code": code})
    assert replayed.status_code == 401
    assert browser.post("/api/admin/session", json=credentials | {"code": recovery[0]}).status_code == 200
    assert browser.post("/api/admin/session", json=credentials | {"code": recovery[0]}).status_code == 401


def test_a_revoked_session_is_over(client: TestClient, settings: Settings, owner: Admin) -> None:
    other = fresh_browser(client, settings)
    other.post("/api/admin/session", json={"name": owner.name, "password": PASSWORD})
    [session] = [row for row in owner.get("/sessions").json() if not row["current"]]
    assert owner.send("DELETE", f"/sessions/{session['id']}").status_code == 204
    assert other.get("/api/admin/studies").status_code == 401


def test_a_new_password_ends_other_sessions(client: TestClient, settings: Settings, owner: Admin) -> None:
    other = fresh_browser(client, settings)
    other.post("/api/admin/session", json={"name": owner.name, "password": PASSWORD})
    body = {"password": PASSWORD, "new_password": "another long one"}
    assert owner.send("PUT", "/password", body).status_code == 204
    assert other.get("/api/admin/studies").status_code == 401
    assert owner.get("/studies").status_code == 200


def test_another_sites_page_cannot_change_anything(owner: Admin) -> None:
    answer = owner.send(
        "POST", "/tokens", {"name": "x", "scopes": ["read"]}, headers={"origin": "https://evil.example"}
    )
    assert (answer.status_code, answer.json()["error"]["code"]) == (403, "not_allowed")
