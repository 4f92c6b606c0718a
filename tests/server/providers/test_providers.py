"""Sign-in with a real OpenID provider over HTTP: honest, and forged in every way that the standard names."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx2
import pyotp
import pytest
from fastapi.testclient import TestClient

from server.accounts import workspaces
from server.accounts.identity import OPERATOR
from server.app import create_app
from server.context import Services
from server.core.limits import RateLimit
from server.core.settings import Provider, RoleRule, Settings
from server.models import Account, AccountLogin, AuditEntry, LoginAttempt
from tests.helpers.admins import PASSWORD, Admin, fresh_browser, signed_in, wrong_code
from tests.helpers.providers import SECRET, RunningProvider, Visitor, provider_for, state_of
from tests.helpers.studies import FROM_OWN_PAGE

PUBLIC_URL = "http://localhost:8000"
REFUSED = "/admin/sign-in?refused=sign_in_refused"
LAB = RoleRule(workspace="vision", role="experimenter", claim="groups", value="vision-lab")


@pytest.fixture(scope="module")
def running() -> Iterator[RunningProvider]:
    with provider_for(PUBLIC_URL, "uni", "other") as provider:
        yield provider


@pytest.fixture
def settings(settings: Settings, running: RunningProvider, tmp_path: Path) -> Settings:
    secret = tmp_path / "client secret"
    secret.write_text(f"{SECRET}\n")
    uni = Provider(
        label="The University",
        issuer=running.issuer,
        client_id="palpebra",
        client_secret_file=secret,
        roles=(LAB,),
        second_factor_acr=("two-factors",),
        second_factor_amr=("mfa",),
    )
    other = uni.model_copy(update={"label": "ORCID", "roles": ()})
    return settings.model_copy(update={"oidc": {"uni": uni, "other": other}, "public_url": PUBLIC_URL})


@pytest.fixture
def client(services: Services) -> Iterator[TestClient]:
    with TestClient(create_app(services.settings), base_url=PUBLIC_URL, headers=FROM_OWN_PAGE) as made:
        yield made


@pytest.fixture(autouse=True)
def vision(services: Services) -> None:
    with services.database.write() as session:
        workspaces.create(session, "vision", "Vision laboratory", OPERATOR)


@pytest.fixture
def visitor(client: TestClient, settings: Settings) -> Visitor:
    return Visitor(fresh_browser(client, settings))


def roles(services: Services, name: str) -> dict[str, str]:
    with services.database.read() as session:
        account = workspaces.account_named(session, name)
        return {workspace.name: role for workspace, role in workspaces.own_workspaces(session, account.id)}


def actions(services: Services, word: str) -> list[tuple[str, Any]]:
    with services.database.read() as session:
        rows = session.query(AuditEntry).filter(AuditEntry.action == word).order_by(AuditEntry.id)
        return [(row.actor, row.details) for row in rows]


def test_a_rule_lets_somebody_in_and_says_where_she_belongs(visitor: Visitor, services: Services) -> None:
    ways = visitor.browser.get("/api/admin/session/ways").json()["providers"]
    assert ways == [{"id": "uni", "label": "The University"}, {"id": "other", "label": "ORCID"}]
    assert visitor.sign_in(next_page="/studies/new", **{"as": "ada"}) == "/admin/studies/new"
    account = visitor.account()
    assert (account["name"], account["role"]) == ("Ada Lovelace", "viewer")
    assert roles(services, "Ada Lovelace") == {"vision": "experimenter"}
    assert actions(services, "signed in") == [("Ada Lovelace", {"provider": "uni"})]
    again = Visitor(fresh_browser(visitor.browser, services.settings))
    again.sign_in(**{"as": "ada"})
    assert again.account()["id"] == account["id"]
    with services.database.read() as session:
        assert [row.subject for row in session.query(AccountLogin)] == ["ada"]
        assert session.query(LoginAttempt).count() == 0


def test_pkce_state_and_nonce_go_out_and_no_secret_does(visitor: Visitor) -> None:
    query = parse_qs(urlsplit(visitor.begin()).query)
    assert query["response_type"] == ["code"]
    assert query["code_challenge_method"] == ["S256"]
    assert len(query["code_challenge"][0]) == 43
    assert query["state"][0] != query["nonce"][0]
    assert SECRET not in str(query)


def test_who_has_no_place_is_not_let_in(visitor: Visitor, services: Services) -> None:
    assert visitor.sign_in(**{"as": "zoe"}) == "/admin/sign-in?refused=not_admitted"
    assert visitor.account() is None
    assert visitor.sign_in("other", **{"as": "ada"}) == "/admin/sign-in?refused=not_admitted"
    with services.database.read() as session:
        assert session.query(Account).count() == 0
    assert [details["reason"] for _, details in actions(services, "sign-in failed")] == ["not_admitted"] * 2


def test_a_lost_claim_takes_the_membership_with_it(visitor: Visitor, services: Services) -> None:
    visitor.sign_in(**{"as": "ada"})
    services.settings.oidc["uni"] = services.settings.oidc["uni"].model_copy(
        update={"roles": (LAB.model_copy(update={"value": "another group"}),)}
    )
    with TestClient(create_app(services.settings), base_url=PUBLIC_URL, headers=FROM_OWN_PAGE) as later:
        again = Visitor(fresh_browser(later, services.settings))
        assert again.sign_in(**{"as": "ada"}) == "/admin/"
    assert roles(services, "Ada Lovelace") == {}
    assert actions(services, "member removed")[0][1]["provider"] == "uni"


def test_a_workspaces_last_owner_stays(visitor: Visitor, services: Services) -> None:
    visitor.sign_in(**{"as": "ada"})
    with services.database.write() as session:
        vision = workspaces.find_workspace(session, "vision")
        workspaces.set_member(session, vision, "Ada Lovelace", "owner", OPERATOR)
    visitor.sign_in(**{"as": "ada"})
    assert roles(services, "Ada Lovelace") == {"vision": "owner"}


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("nonce", "Invalid claim: 'nonce'"),
        ("no nonce", "Missing claim: 'nonce'"),
        ("alg none", "'none' is not allowed"),
        ("audience", "Invalid claim: 'aud'"),
        ("two audiences", "Invalid claim: 'azp'"),
        ("expired", "ExpiredTokenError"),
        ("from the future", "issued in the future"),
        ("client's secret", "'HS256' is not allowed"),
        ("issuer", "Invalid claim: 'iss'"),
        ("signature", "BadSignatureError"),
        ("no subject", "Missing claim: 'sub'"),
    ],
)
def test_a_forged_id_token_signs_nobody_in(
    how: str,
    reason: str,
    visitor: Visitor,
    running: RunningProvider,
    services: Services,
    caplog: pytest.LogCaptureFixture,
) -> None:
    back = visitor.authorise(visitor.begin(), **{"as": "ada"})
    running.spoil(how)
    assert visitor.come_back(back) == REFUSED
    assert reason in caplog.text
    assert visitor.account() is None
    assert len(actions(services, "sign-in failed")) == 1
    assert visitor.sign_in(**{"as": "ada"}) == "/admin/"


def test_an_answer_counts_once(visitor: Visitor) -> None:
    back = visitor.authorise(visitor.begin(), **{"as": "ada"})
    assert visitor.come_back(back) == "/admin/"
    visitor.browser.cookies.clear()
    assert visitor.come_back(back) == REFUSED
    assert visitor.account() is None


def test_a_replayed_state_is_refused_even_with_its_cookie(visitor: Visitor) -> None:
    address = visitor.begin()
    cookies = dict(visitor.browser.cookies)
    back = visitor.authorise(address, **{"as": "ada"})
    visitor.come_back(back)
    visitor.browser.cookies.clear()
    visitor.browser.cookies.update(cookies)
    fresh = visitor.authorise(address, **{"as": "ada"})
    assert visitor.come_back(fresh) == REFUSED
    assert visitor.account() is None


def test_an_attackers_answer_does_not_work_in_another_browser(
    visitor: Visitor, client: TestClient, settings: Settings
) -> None:
    """Login CSRF: a victim who follows an attacker's link is not signed in as the attacker."""
    attackers = visitor.authorise(visitor.begin(), **{"as": "eve"})
    victim = Visitor(fresh_browser(client, settings))
    assert victim.come_back(attackers) == REFUSED
    victim.begin()
    assert victim.come_back(attackers) == REFUSED
    assert victim.account() is None


def test_an_answer_at_another_providers_address_is_refused(visitor: Visitor) -> None:
    back = visitor.authorise(visitor.begin("uni"), **{"as": "ada"})
    assert visitor.come_back(back.replace("/uni/callback", "/other/callback")) == REFUSED
    assert visitor.come_back(back) == REFUSED
    assert visitor.account() is None


@pytest.mark.parametrize("iss", ["https://another.example", None])
def test_an_answer_that_names_another_issuer_or_none_is_refused(visitor: Visitor, iss: str | None) -> None:
    """Mix-up (RFC 9207): the provider says that it always names itself."""
    back = httpx2.URL(visitor.authorise(visitor.begin(), **{"as": "ada"}))
    assert "iss" in back.params
    changed = back.copy_remove_param("iss") if iss is None else back.copy_set_param("iss", iss)
    assert visitor.come_back(str(changed)) == REFUSED
    assert visitor.account() is None


def test_who_comes_back_too_often_waits_and_loses_no_sign_in(visitor: Visitor) -> None:
    back = visitor.authorise(visitor.begin(), **{"as": "ada"})
    throttle = visitor.browser.app.state.services.sign_ins  # type: ignore[attr-defined]
    usual, throttle.per_range = throttle.per_range, RateLimit(2, clock=lambda: 0.0)
    made_up = back.replace("state=", "state=x")
    assert [visitor.come_back(one) for one in (made_up, made_up, back)] == [
        REFUSED,
        REFUSED,
        "/admin/sign-in?refused=too_many_requests",
    ]
    throttle.per_range = usual
    assert visitor.come_back(back) == "/admin/"


def test_a_code_without_its_verifier_is_worth_nothing(visitor: Visitor, running: RunningProvider) -> None:
    """PKCE: who steals the code from the address cannot exchange it, the client's secret in hand."""
    back = parse_qs(urlsplit(visitor.authorise(visitor.begin(), **{"as": "ada"})).query)
    stolen = {
        "grant_type": "authorization_code",
        "code": back["code"][0],
        "redirect_uri": f"{PUBLIC_URL}/api/admin/session/providers/uni/callback",
    }
    for verifier in ({}, {"code_verifier": "x" * 43}):
        answer = httpx2.post(
            f"{running.issuer}/token", data={**stolen, **verifier}, auth=("palpebra", SECRET)
        )
        assert answer.status_code == 400


@pytest.mark.parametrize(
    "page", ["https://evil.example", "//evil.example", "/\\evil.example", "evil", "/a\nb", "\\\\evil"]
)
def test_no_page_elsewhere_is_gone_on_to(visitor: Visitor, page: str) -> None:
    answer = visitor.browser.post("/api/admin/session/providers/uni", json={"next": page})
    assert answer.status_code == 422


def test_nothing_of_the_answers_address_is_followed(visitor: Visitor) -> None:
    answer = visitor.browser.get(
        "/api/admin/session/providers/uni/callback",
        params={"state": "x", "code": "y", "next": "https://evil.example", "error": "https://evil.example"},
        follow_redirects=False,
    )
    assert answer.headers["location"] == REFUSED


def test_saying_no_at_the_provider_leads_back(visitor: Visitor) -> None:
    assert visitor.come_back(visitor.authorise(visitor.begin())) == REFUSED


def test_another_sites_page_cannot_begin_a_sign_in(visitor: Visitor) -> None:
    answer = visitor.browser.post(
        "/api/admin/session/providers/uni", json={}, headers={"origin": "https://evil.example"}
    )
    assert answer.status_code == 403


def test_a_name_or_mail_that_is_somebodys_does_not_open_her_account(
    visitor: Visitor, client: TestClient, services: Services
) -> None:
    owner = signed_in(client, services, "owner")
    visitor.sign_in(**{"as": "eve"})
    assert visitor.account()["name"] == "the owner 2"
    assert visitor.account()["id"] != owner.get("/session").json()["account"]["id"]


def linked(admin: Admin, who: str, provider: str = "other") -> str:
    """Give an account a login, as its browser does."""
    url = admin.send("POST", f"/logins/{provider}", {"proof": PASSWORD}).json()["url"]
    visitor = Visitor(admin.client)  # type: ignore[arg-type]
    return visitor.come_back(visitor.authorise(url, **{"as": who}))


def test_an_account_gets_a_login_only_while_signed_in(
    visitor: Visitor, client: TestClient, services: Services
) -> None:
    assert visitor.browser.post("/api/admin/logins/other", json={"proof": PASSWORD}).status_code == 401
    owner = signed_in(client, services, "owner")
    assert linked(owner, "zoe") == "/admin/account"
    assert visitor.sign_in("other", **{"as": "zoe"}) == "/admin/"
    assert visitor.account()["name"] == owner.name
    assert actions(services, "login added")[0][0] == owner.name


def test_a_login_of_another_account_is_not_taken_over(client: TestClient, services: Services) -> None:
    owner, other = signed_in(client, services, "owner"), signed_in(client, services, "viewer")
    linked(owner, "zoe")
    assert linked(other, "zoe") == "/admin/account?refused=conflict"
    assert other.get("/logins").json() == []
    foreign = owner.get("/logins").json()[0]["id"]
    assert other.send("DELETE", f"/logins/{foreign}").status_code == 404


def test_a_session_that_ended_meanwhile_gets_no_login(
    client: TestClient, services: Services, visitor: Visitor
) -> None:
    owner = signed_in(client, services, "owner")
    url = owner.send("POST", "/logins/other", {"proof": PASSWORD}).json()["url"]
    back = visitor.authorise(url, **{"as": "zoe"})
    owner.send("DELETE", "/session")
    answer = owner.client.get(back, follow_redirects=False)
    assert answer.headers["location"] == "/admin/account?refused=sign_in_refused"
    with services.database.read() as session:
        assert session.query(AccountLogin).count() == 0


def test_the_last_way_in_stays(visitor: Visitor, client: TestClient, services: Services) -> None:
    visitor.sign_in(**{"as": "ada"})
    ada = Admin(visitor.browser, "Ada Lovelace")
    login = ada.get("/logins").json()[0]
    assert ada.send("DELETE", f"/logins/{login['id']}").status_code == 409
    owner = signed_in(client, services, "owner")
    linked(owner, "zoe")
    own = owner.get("/logins").json()[0]
    assert owner.send("DELETE", f"/logins/{own['id']}").status_code == 204
    assert actions(services, "login removed")[0][0] == owner.name


def test_an_account_without_a_password_is_not_opened_by_any(
    visitor: Visitor, client: TestClient, settings: Settings
) -> None:
    visitor.sign_in(**{"as": "ada"})
    browser = fresh_browser(client, settings)
    for password in ("x", "the password of an account that does not exist"):
        answer = browser.post("/api/admin/session", json={"name": "Ada Lovelace", "password": password})
        assert answer.json()["error"]["code"] == "wrong_credentials"


def second_factor_session(browser: TestClient, services: Services) -> bool:
    with services.database.write() as session:
        vision = workspaces.find_workspace(session, "vision")
        vision.second_factor_required = True
    mine = browser.get("/api/admin/session").json()["workspaces"]
    return not next(one for one in mine if one["name"] == "vision")["second_factor_needed"]


@pytest.mark.parametrize(
    ("said", "counts"),
    [({}, False), ({"amr": "pwd"}, False), ({"amr": "pwd mfa"}, True), ({"acr": "two-factors"}, True)],
)
def test_a_workspaces_second_factor_counts_where_the_provider_is_trusted_with_it(
    visitor: Visitor, services: Services, said: dict[str, str], counts: bool
) -> None:
    visitor.sign_in(**{"as": "ada"}, **said)
    assert second_factor_session(visitor.browser, services) is counts


def test_an_accounts_own_second_factor_is_asked_for_after_the_provider(
    client: TestClient, services: Services, visitor: Visitor
) -> None:
    owner = signed_in(client, services, "owner")
    linked(owner, "zoe")
    secret = owner.send("POST", "/second-factor").json()["secret"]
    recovery = owner.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).json()["codes"]
    assert visitor.sign_in("other", "/people", **{"as": "zoe"}) == "/admin/sign-in?code=asked"
    assert visitor.account() is None
    send = visitor.browser.post
    wrong = send("/api/admin/session/code", json={"code": wrong_code(secret)})
    assert (wrong.status_code, visitor.account()) == (401, None)
    assert send("/api/admin/session/code", json={"code": recovery[0]}).json() == {"next": "/people"}
    assert visitor.account()["name"] == owner.name
    again = send("/api/admin/session/code", json={"code": recovery[1]})
    assert again.json()["error"]["code"] == "sign_in_refused"


def test_codes_after_a_provider_cannot_be_tried_for_ever(
    client: TestClient, services: Services, visitor: Visitor
) -> None:
    owner = signed_in(client, services, "owner")
    linked(owner, "zoe")
    secret = owner.send("POST", "/second-factor").json()["secret"]
    owner.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()})
    visitor.sign_in("other", **{"as": "zoe"})
    answers = [visitor.browser.post("/api/admin/session/code", json={"code": "0" * 8}) for _ in range(8)]
    assert answers[-1].json()["error"]["code"] == "too_many_failures"


def test_a_closed_account_stays_closed(visitor: Visitor, client: TestClient, services: Services) -> None:
    visitor.sign_in(**{"as": "ada"})
    owner, ada = signed_in(client, services, "owner"), visitor.account()["id"]
    assert owner.send("PATCH", f"/accounts/{ada}", {"disabled": True}).status_code == 200
    assert visitor.sign_in(**{"as": "ada"}) == "/admin/sign-in?refused=not_admitted"


def test_neither_verifier_nor_nonce_nor_state_lies_in_the_database(
    visitor: Visitor, services: Services
) -> None:
    url = visitor.begin()
    query = parse_qs(urlsplit(url).query)
    with services.database.read() as session:
        row = session.query(LoginAttempt).one()
        stored = " ".join(str(getattr(row, column.name)) for column in LoginAttempt.__table__.columns)
    assert state_of(url) not in stored
    assert query["nonce"][0] not in stored
    assert visitor.browser.cookies["palpebra_login"] not in stored


def test_the_cookie_of_a_sign_in_under_way_is_out_of_scripts_reach(visitor: Visitor) -> None:
    answer = visitor.browser.post("/api/admin/session/providers/uni", json={})
    cookie = answer.headers["set-cookie"].lower()
    assert {"httponly", "samesite=lax", "path=/api/admin/session"} <= {
        part.strip() for part in cookie.split(";")
    }


def test_an_unknown_provider_and_one_that_is_away(visitor: Visitor, settings: Settings) -> None:
    assert visitor.browser.post("/api/admin/session/providers/nobody", json={}).status_code == 404
    gone = settings.oidc["uni"].model_copy(update={"issuer": "http://127.0.0.1:9"})
    with TestClient(create_app(settings.model_copy(update={"oidc": {"uni": gone}}))) as client:
        answer = client.post("/api/admin/session/providers/uni", json={})
    assert (answer.status_code, answer.json()["error"]["code"]) == (503, "provider_away")


def test_a_password_signs_in_as_before(client: TestClient, services: Services, settings: Settings) -> None:
    owner = signed_in(client, services, "owner")
    browser = fresh_browser(client, settings)
    body = {"name": owner.name, "password": PASSWORD}
    assert browser.post("/api/admin/session", json=body).status_code == 200
