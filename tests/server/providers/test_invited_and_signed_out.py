"""An invited person makes her account by a provider; signing out there ends the sessions that it began."""

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from server.accounts import invitations
from server.context import Services
from server.core.limits import RateLimit
from server.core.settings import Provider, RoleRule, Settings
from server.models import DEFAULT_WORKSPACE, Account, AuditEntry
from tests.helpers.admins import PASSWORD, fresh_browser, signed_in
from tests.helpers.providers import RunningProvider, Visitor, provider_for

PUBLIC_URL = "http://localhost:8000"


@pytest.fixture(scope="module")
def running() -> Iterator[RunningProvider]:
    with provider_for(PUBLIC_URL, "uni") as provider:
        yield provider


@pytest.fixture
def settings(settings: Settings, running: RunningProvider, tmp_path) -> Settings:
    secret = tmp_path / "secret"
    secret.write_text("a secret between the two")
    uni = Provider(
        label="The University", issuer=running.issuer, client_id="palpebra", client_secret_file=secret
    )
    return settings.model_copy(update={"oidc": {"uni": uni}, "public_url": PUBLIC_URL})


@pytest.fixture
def visitor(client: TestClient, services: Services) -> Visitor:
    return Visitor(fresh_browser(client, services.settings))


def invited(services: Services) -> str:
    return invitations.invite(services.database, "experimenter", "for Ada", None)[1]


def begin(visitor: Visitor, token: str, provider: str = "uni") -> str:
    answer = visitor.browser.post(f"/api/admin/invitations/{token}/providers/{provider}")
    assert answer.status_code == 200, answer.text
    return str(answer.json()["url"])


def names(services: Services) -> list[str]:
    with services.database.read() as session:
        return sorted(account.name for account in session.query(Account))


def test_an_invited_person_needs_no_password(visitor: Visitor, services: Services) -> None:
    token = invited(services)
    address = visitor.authorise(begin(visitor, token), **{"as": "zoe"})
    assert visitor.come_back(address) == "/admin/"
    assert (visitor.account()["name"], visitor.account()["role"]) == ("Zoe", "experimenter")
    state = visitor.browser.get(f"/api/admin/invitations/{token}/state").json()["status"]
    assert state == "used"
    assert visitor.browser.get("/api/admin/session").json()["workspaces"][0]["role"] == "experimenter"
    again = Visitor(visitor.browser)
    assert again.sign_in(**{"as": "zoe"}) == "/admin/"
    assert names(services) == ["Zoe"]


def test_an_invitation_is_used_once_by_whatever_way(
    client: TestClient, visitor: Visitor, services: Services
) -> None:
    token = invited(services)
    address = visitor.authorise(begin(visitor, token), **{"as": "zoe"})
    meanwhile = fresh_browser(client, services.settings)
    made = meanwhile.post(
        f"/api/admin/invitations/{token}/account", json={"name": "first", "password": PASSWORD}
    )
    assert made.status_code == 201
    assert visitor.come_back(address) == "/admin/sign-in?refused=conflict"
    assert (visitor.account(), names(services)) == (None, ["first"])
    assert visitor.browser.post(f"/api/admin/invitations/{token}/providers/uni").status_code == 409
    assert visitor.browser.post("/api/admin/invitations/unknown/providers/uni").status_code == 404


def test_an_invitation_taken_back_meanwhile_makes_nobody(visitor: Visitor, services: Services) -> None:
    invitation, token = invitations.invite(services.database, "owner", "", None)
    address = visitor.authorise(begin(visitor, token), **{"as": "zoe"})
    with services.database.write() as session:
        session.delete(session.merge(invitation))
    assert visitor.come_back(address) == "/admin/sign-in?refused=conflict"
    assert names(services) == []


def test_an_invitation_taken_back_is_not_the_next_one(
    client: TestClient, visitor: Visitor, services: Services
) -> None:
    """SQLite gives the next invitation the number of the one that was removed."""
    owner = signed_in(client, services, "owner")
    invitation, token = invitations.invite(services.database, "viewer", "", None)
    address = visitor.authorise(begin(visitor, token), **{"as": "zoe"})
    assert owner.send("DELETE", f"/invitations/{invitation.id}").status_code == 204
    _, second = invitations.invite(services.database, "owner", "", None)
    assert visitor.come_back(address) == "/admin/sign-in?refused=conflict"
    assert (visitor.account(), names(services)) == (None, [owner.name])
    assert visitor.browser.get(f"/api/admin/invitations/{second}/state").json()["status"] == "open"


@pytest.mark.parametrize("when", ["begin", "come back"])
def test_a_workspace_whose_members_the_provider_says_is_not_entered_by_its_invitation(
    visitor: Visitor, services: Services, when: str
) -> None:
    token = invited(services)
    address = visitor.authorise(begin(visitor, token), **{"as": "zoe"})
    rule = RoleRule(claim="groups", value="staff", workspace=DEFAULT_WORKSPACE, role="viewer")
    services.settings.oidc["uni"] = services.settings.oidc["uni"].model_copy(update={"roles": (rule,)})
    if when == "begin":
        refused = visitor.browser.post(f"/api/admin/invitations/{token}/providers/uni")
        assert refused.status_code == 409
        assert "The University manages the members of" in refused.json()["error"]["message"]
    else:
        assert visitor.come_back(address) == "/admin/sign-in?refused=conflict"
    assert visitor.browser.get(f"/api/admin/invitations/{token}/state").json()["status"] == "open"
    assert names(services) == []


def test_a_login_that_is_somebodys_uses_no_invitation(visitor: Visitor, services: Services) -> None:
    visitor.come_back(visitor.authorise(begin(visitor, invited(services)), **{"as": "zoe"}))
    second = invited(services)
    address = visitor.authorise(begin(visitor, second), **{"as": "zoe"})
    assert visitor.come_back(address) == "/admin/sign-in?refused=conflict"
    assert visitor.browser.get(f"/api/admin/invitations/{second}/state").json()["status"] == "open"
    assert names(services) == ["Zoe"]


@pytest.fixture
def zoe(visitor: Visitor, services: Services) -> Visitor:
    visitor.come_back(visitor.authorise(begin(visitor, invited(services)), **{"as": "zoe"}))
    assert visitor.account() is not None
    return visitor


def tell(browser: TestClient, token: str) -> int:
    status: int = browser.post(
        "/api/admin/session/providers/uni/logout", data={"logout_token": token}
    ).status_code
    return status


def test_signing_out_at_the_provider_ends_its_sessions(
    client: TestClient, zoe: Visitor, services: Services, running: RunningProvider
) -> None:
    other = signed_in(client, services, "owner")
    assert tell(fresh_browser(client, services.settings), running.logout_token("zoe")) == 204
    assert zoe.account() is None
    assert other.get("/accounts").status_code == 200
    with services.database.read() as session:
        told = session.query(AuditEntry).filter_by(action="signed out by provider").one()
    assert (told.target, told.details) == ("Zoe", {"provider": "uni", "sessions": 1})


def test_somebody_elses_signing_out_ends_nothing(
    client: TestClient, zoe: Visitor, services: Services, running: RunningProvider
) -> None:
    assert tell(fresh_browser(client, services.settings), running.logout_token("ada")) == 204
    assert zoe.account() is not None


@pytest.mark.parametrize(
    "how",
    [
        "no event", "with a nonce", "old", "expired", "signature", "alg none", "client's secret", "audience",
        "issuer", "no subject",
    ],
)  # fmt: skip
def test_forged_logout_tokens_end_nothing(
    client: TestClient, zoe: Visitor, services: Services, running: RunningProvider, how: str
) -> None:
    stranger = fresh_browser(client, services.settings)
    assert tell(stranger, running.logout_token("zoe", how)) == 400
    assert tell(stranger, "nonsense") == 400
    assert zoe.account() is not None


def test_a_login_taken_off_ends_what_its_provider_began(
    client: TestClient, zoe: Visitor, services: Services
) -> None:
    other = Visitor(fresh_browser(client, services.settings))
    assert other.sign_in(**{"as": "zoe"}) == "/admin/"
    with services.database.write() as session:
        session.query(Account).one().password_hash = "scrypt$never"
    own = zoe.browser.get("/api/admin/logins").json()[0]["id"]
    assert zoe.browser.delete(f"/api/admin/logins/{own}").status_code == 204
    assert other.account() is None
    assert zoe.account() is not None


def test_forged_logouts_are_limited_by_themselves(
    client: TestClient, zoe: Visitor, services: Services, running: RunningProvider
) -> None:
    throttle = services.sign_ins
    throttle.logouts = RateLimit(2, clock=lambda: 0.0)
    stranger = fresh_browser(client, services.settings)
    assert [tell(stranger, "nonsense") for _ in range(3)] == [400, 400, 429]
    throttle.logouts = RateLimit(2, clock=lambda: 0.0)
    token = running.logout_token
    assert [tell(stranger, token("ada")) for _ in range(4)] == [204] * 4
    assert tell(stranger, token("zoe")) == 204
    assert zoe.account() is None


def test_a_logout_token_ends_sessions_once(
    client: TestClient, zoe: Visitor, services: Services, running: RunningProvider
) -> None:
    told = running.logout_token("zoe")
    provider = fresh_browser(client, services.settings)
    assert tell(provider, told) == 204
    assert Visitor(zoe.browser).sign_in(**{"as": "zoe"}) == "/admin/"
    assert tell(provider, told) == 204
    assert zoe.account() is not None


def test_a_logout_without_a_token_is_a_bad_request(client: TestClient, services: Services) -> None:
    answer = fresh_browser(client, services.settings).post("/api/admin/session/providers/uni/logout")
    assert (answer.status_code, answer.headers["cache-control"]) == (400, "no-store")
