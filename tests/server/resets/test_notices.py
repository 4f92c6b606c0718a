"""The owner of an address gets an email about every change of what opens the account."""

from collections.abc import Callable
from datetime import timedelta

import pyotp
import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from server.accounts import letters
from server.accounts.letters import Notice
from server.cli import app
from server.context import Services
from server.core.settings import Settings
from server.core.values import now
from server.models import Account, AccountLogin, AdminSession
from tests.helpers.admins import PASSWORD, Admin, fresh_browser
from tests.helpers.mail import ADDRESS, Letterbox

FRESH = "an entirely new passphrase"


def _with_factor(ada: Admin) -> list[str]:
    secret = ada.send("POST", "/second-factor").json()["secret"]
    codes: list[str] = ada.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).json()["codes"]
    return codes


def _change(ada: Admin, services: Services) -> None:
    ada.send("PUT", "/password", {"password": PASSWORD, "new_password": FRESH})


def _add_factor(ada: Admin, services: Services) -> None:
    _with_factor(ada)


def _remove_factor(ada: Admin, services: Services) -> None:
    assert ada.send("DELETE", "/second-factor", {"password": PASSWORD}).status_code == 204


def _remove_login(ada: Admin, services: Services) -> None:
    with services.database.write() as session:
        account = session.query(Account).one()
        login = AccountLogin(account_id=account.id, provider="uni", issuer="https://uni.example", subject="a")
        session.add(login)
        session.flush()
        number = login.id
    assert ada.send("DELETE", f"/logins/{number}").status_code == 204


def _sign_in_elsewhere(ada: Admin, services: Services) -> None:
    browser = fresh_browser(ada.client, services.settings)
    body = {"name": "ada", "password": PASSWORD}
    for _ in range(2):  # the second time the browser is known
        assert browser.post("/api/admin/session", json=body).status_code == 200


def _sign_in_by_recovery_code(ada: Admin, services: Services) -> None:
    code = _with_factor(ada)[0]
    browser = fresh_browser(ada.client, services.settings)
    body = {"name": "ada", "password": PASSWORD, "code": code}
    assert browser.post("/api/admin/session", json=body).status_code == 200


@pytest.mark.parametrize(
    ("changes", "notice"),
    [
        (_change, letters.PASSWORD_CHANGED),
        (_add_factor, letters.SECOND_FACTOR_ADDED),
        (_remove_factor, letters.SECOND_FACTOR_REMOVED),
        (_remove_login, letters.LOGIN_REMOVED),
        (_sign_in_elsewhere, letters.NEW_BROWSER),
        (_sign_in_by_recovery_code, letters.RECOVERY_CODE_USED),
    ],
    ids=lambda value: value.subject if isinstance(value, Notice) else value.__name__,
)
def test_a_letter_says_what_changed(
    ada: Admin,
    services: Services,
    box: Letterbox,
    changes: Callable[[Admin, Services], None],
    notice: Notice,
) -> None:
    changes(ada, services)
    told = [letter for letter in box.letters if letter["Subject"] == notice.subject]
    assert [letter["To"] for letter in told] == [ADDRESS]
    assert "'ada'" in told[0].get_content()
    assert PASSWORD not in told[0].get_content() + FRESH


def test_nobody_gets_a_notice_of_what_did_not_happen(
    ada: Admin, stranger: TestClient, box: Letterbox
) -> None:
    ada.send("PUT", "/password", {"password": "wrong", "new_password": FRESH})
    ada.send("DELETE", "/second-factor", {"password": "wrong"})
    ada.send("DELETE", "/logins/99")
    stranger.post("/api/admin/session", json={"name": "ada", "password": "wrong"})
    assert box.letters == []


def test_the_command_line_shows_it_too(
    ada: Admin, settings: Settings, box: Letterbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {
        "DATA_FOLDER": str(settings.data_folder), "SMTP_HOST": settings.smtp_host,
        "SMTP_PORT": str(settings.smtp_port), "SMTP_SECURITY": "none", "MAIL_FROM": settings.mail_from,
        "PUBLIC_URL": settings.public_url,
    }.items():  # fmt: skip
        monkeypatch.setenv(f"PALPEBRA_{name}", value)
    monkeypatch.setenv("DATABASE_URL", settings.resolved_database_url)
    for words in (["reset-password", "ada", "--password", FRESH], ["reset-second-factor", "ada"]):
        called = CliRunner().invoke(app, ["account", *words])
        assert called.exit_code == 0, called.output
    expected = [letters.PASSWORD_RESET.subject, letters.SECOND_FACTOR_REMOVED.subject]
    assert [letter["Subject"] for letter in box.letters] == expected


def test_a_session_that_nobody_uses_ends(ada: Admin, services: Services) -> None:
    idle = services.settings.session_idle
    assert idle < timedelta(hours=services.settings.session_hours)
    with services.database.write() as session:
        row = session.query(AdminSession).one()
        row.last_seen_at = now() - idle + timedelta(minutes=1)
    assert ada.get("/studies").status_code == 200
    assert len(ada.get("/sessions").json()) == 1
    with services.database.write() as session:
        session.query(AdminSession).one().last_seen_at = now() - idle
    refused = ada.get("/studies")
    assert (refused.status_code, refused.json()["error"]["code"]) == (401, "not_signed_in")
