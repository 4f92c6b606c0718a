"""Hashes, codes and tokens: as strong as today asks, without locking anybody out who has older ones."""

from datetime import datetime, timedelta

import pytest
from fastapi.testclient import TestClient
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from server.accounts import credentials
from server.accounts.schemas import TOKEN_DAYS_MAX
from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Account, ApiToken
from server.operations.doctor import tokens
from tests.helpers.admins import PASSWORD, Admin, fresh_browser, wrong_code

OLDER = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=16, parallelism=1),))


def stored(services: Services) -> str:
    with services.database.read() as session:
        return session.query(Account).one().password_hash


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_hash_of_older_parameters_is_renewed_at_the_next_sign_in(
    client: TestClient, settings: Settings, services: Services, owner: Admin
) -> None:
    older = OLDER.hash(PASSWORD)
    with services.database.write() as session:
        session.query(Account).update({"password_hash": older})
    browser = fresh_browser(client, settings)
    wrong = browser.post("/api/admin/session", json={"name": owner.name, "password": PASSWORD + "!"})
    assert (wrong.status_code, stored(services)) == (401, older)
    credentials = {"name": owner.name, "password": PASSWORD}
    assert browser.post("/api/admin/session", json=credentials).status_code == 200
    renewed = stored(services)
    assert "m=8," in renewed
    assert browser.post("/api/admin/session", json=credentials).status_code == 200
    assert stored(services) == renewed


def test_a_recovery_code_has_at_least_112_bits() -> None:
    codes = credentials.new_recovery_codes()
    assert len(set(codes)) == credentials.RECOVERY_CODES
    for code in codes:
        assert 5 * len(code.replace("-", "")) >= 112
        assert credentials.is_recovery_code(code)
        assert len(code) <= 40  # what the form takes


@pytest.mark.parametrize("days", [0, 3651])
def test_no_token_ends_at_once_or_in_the_next_decade(owner: Admin, days: int) -> None:
    answer = owner.send("POST", "/tokens", {"name": "x", "scopes": ["read"], "days": days})
    assert answer.status_code == 422
    assert owner.get("/tokens").json() == []


@pytest.mark.parametrize("days", [None, 367, 3650])
def test_older_clients_that_ask_for_more_get_a_token_that_ends_as_late_as_any_may(
    owner: Admin, days: int | None
) -> None:
    answer = owner.send("POST", "/tokens", {"name": "x", "scopes": ["read"], "days": days})
    assert answer.status_code < 300, answer.text
    ends, made = (datetime.fromisoformat(answer.json()[name]) for name in ("expires_at", "created_at"))
    assert (ends - made).days in (TOKEN_DAYS_MAX - 1, TOKEN_DAYS_MAX)


def test_tokens_of_before_stay_and_the_doctor_names_them(services: Services, owner: Admin) -> None:
    made = owner.send("POST", "/tokens", {"name": "nightly", "scopes": ["read"]}).json()
    assert [finding.verdict for finding in tokens(services)] == ["ok"]
    with services.database.write() as session:
        session.query(ApiToken).update({"expires_at": None})
        session.add(
            ApiToken(
                account_id=1,
                name="decade",
                token_hash="0" * 64,
                scopes=["read"],
                expires_at=now() + timedelta(days=3000),
            )
        )
    [finding] = tokens(services)
    assert finding.verdict == "warning"
    assert "nightly (the owner)" in finding.state
    assert "decade (the owner)" in finding.state
    bearer = {"authorization": f"Bearer {made['token']}"}
    browser = fresh_browser(owner.client, services.settings)
    assert browser.get("/api/admin/studies", headers=bearer).status_code == 200


def test_owners_may_be_asked_for_a_second_factor(services: Services, owner: Admin) -> None:
    assert owner.get("/accounts").status_code == 200
    services.settings.owners_second_factor = True
    for method, path in (("GET", "/accounts"), ("GET", "/audit"), ("POST", "/invitations")):
        refused = owner.send(method, path, {"role": "viewer"} if method == "POST" else None)
        assert (refused.status_code, refused.json()["error"]["code"]) == (403, "second_factor_needed")
    assert [row["name"] for row in owner.get("/workspaces").json()] == ["default"]
    secret = owner.send("POST", "/second-factor").json()["secret"]
    assert owner.send("PUT", "/second-factor", {"code": wrong_code(secret)}).status_code == 401
    code = credentials.pyotp.TOTP(secret).now()
    assert owner.send("PUT", "/second-factor", {"code": code}).status_code == 200
    assert owner.get("/accounts").status_code == 200


def test_an_owner_without_a_second_factor_sees_no_other_laboratory(
    services: Services, owner: Admin, experimenter: Admin
) -> None:
    assert experimenter.send("POST", "/workspaces", {"name": "other", "title": "Other"}).status_code == 201
    assert {row["name"] for row in owner.get("/workspaces").json()} == {"default", "other"}
    services.settings.owners_second_factor = True
    assert {row["name"] for row in owner.get("/workspaces").json()} == {"default"}
    assert owner.get("/workspaces/other/members").status_code == 404
