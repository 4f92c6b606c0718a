"""A login is added by the account's own person, and a reset leaves none of a stranger's."""

from collections.abc import Iterator
from pathlib import Path

import pyotp
import pytest
from fastapi.testclient import TestClient

from server.accounts import service as accounts
from server.accounts.credentials import hash_password
from server.accounts.letters import LOGIN_ADDED
from server.accounts.throttle import BackOff
from server.context import Services
from server.core.settings import Provider, Settings
from server.models import Account, AccountLogin, AuditEntry, LoginAttempt
from tests.helpers.admins import PASSWORD, Admin, signed_in, wrong_code
from tests.helpers.mail import ADDRESS, smtp_server
from tests.helpers.providers import SECRET, RunningProvider, Visitor, provider_for

PUBLIC_URL = "http://localhost:8000"
FRESH = "an entirely new passphrase"


@pytest.fixture(scope="module")
def running() -> Iterator[RunningProvider]:
    with provider_for(PUBLIC_URL, "uni") as provider:
        yield provider


@pytest.fixture
def settings(settings: Settings, running: RunningProvider, tmp_path: Path) -> Settings:
    secret = tmp_path / "client secret"
    secret.write_text(SECRET)
    uni = Provider(
        label="The University", issuer=running.issuer, client_id="palpebra", client_secret_file=secret
    )
    return settings.model_copy(update={"oidc": {"uni": uni}, "public_url": PUBLIC_URL})


@pytest.fixture
def ada(client: TestClient, services: Services) -> Admin:
    return signed_in(client, services, "viewer", "ada")


def begin(admin: Admin, proof: str) -> int:
    status: int = admin.send("POST", "/logins/uni", {"proof": proof}).status_code
    return status


def without_password(services: Services) -> None:
    with services.database.write() as session:
        session.query(Account).one().password_hash = ""


def with_login(services: Services) -> None:
    with services.database.write() as session:
        account = session.query(Account).one()
        session.add(
            AccountLogin(account_id=account.id, provider="uni", issuer="https://uni.example", subject="e")
        )


def logins(services: Services) -> int:
    with services.database.read() as session:
        return session.query(AccountLogin).count()


def test_an_open_browser_alone_adds_no_login(ada: Admin, services: Services) -> None:
    assert ada.send("POST", "/logins/uni").status_code == 422
    assert begin(ada, "not the password") == 401
    with services.database.read() as session:
        assert session.query(LoginAttempt).count() == 0
    assert begin(ada, PASSWORD) == 200


def test_passwords_cannot_be_tried_in_a_stolen_session(ada: Admin) -> None:
    throttle = ada.client.app.state.services.sign_ins  # type: ignore[attr-defined]
    throttle.names = BackOff(clock=lambda: 0.0)
    assert [begin(ada, "not the password") for _ in range(8)][-1] == 429


def test_an_account_without_a_password_gives_a_code_which_works_once(ada: Admin, services: Services) -> None:
    without_password(services)
    assert begin(ada, PASSWORD) == 409
    secret = ada.send("POST", "/second-factor").json()["secret"]
    recovery = ada.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).json()["codes"]
    assert [begin(ada, code) for code in (wrong_code(secret), recovery[0], recovery[0])] == [401, 200, 401]


def test_a_new_password_ends_a_login_under_way(
    ada: Admin, services: Services, running: RunningProvider
) -> None:
    url = ada.send("POST", "/logins/uni", {"proof": PASSWORD}).json()["url"]
    visitor = Visitor(ada.client)  # type: ignore[arg-type]
    back = visitor.authorise(url, **{"as": "eve"})
    body = {"password": PASSWORD, "new_password": FRESH}
    assert ada.send("PUT", "/password", body).status_code == 204
    assert "refused=" in visitor.come_back(back)
    assert logins(services) == 0


def test_a_letter_reports_a_login_that_was_added(ada: Admin, services: Services) -> None:
    with services.database.write() as session:
        session.query(Account).one().email = ADDRESS
    with smtp_server() as (box, port):
        for name, value in {"host": "127.0.0.1", "port": port, "security": "none"}.items():
            setattr(services.settings, f"smtp_{name}", value)
        services.settings.mail_from = "palpebra@lab.example"
        visitor = Visitor(ada.client)  # type: ignore[arg-type]
        url = ada.send("POST", "/logins/uni", {"proof": PASSWORD}).json()["url"]
        assert "refused=" not in visitor.come_back(visitor.authorise(url, **{"as": "eve"}))
    assert logins(services) == 1
    assert [(letter["To"], letter["Subject"]) for letter in box.letters] == [(ADDRESS, LOGIN_ADDED.subject)]


def test_a_reset_removes_the_logins_and_says_which(ada: Admin, services: Services) -> None:
    with_login(services)
    with services.database.write() as session:
        _, said = accounts.reset_password(session, "ada", hash_password(FRESH, "ada"))
    assert "https://uni.example were removed" in said
    assert logins(services) == 0
    with services.database.read() as session:
        removed = session.query(AuditEntry).filter(AuditEntry.action == "login removed").one()
        assert removed.details["issuer"] == "https://uni.example"


def test_a_reset_of_an_account_without_password_names_its_logins(ada: Admin, services: Services) -> None:
    with_login(services)
    without_password(services)
    with services.database.write() as session:
        _, said = accounts.reset_password(session, "ada", hash_password(FRESH, "ada"))
    assert "Logins from https://uni.example still work" in said
    assert logins(services) == 1
