"""What would outlive a stolen session is given to a browser alone that signed in a short while ago."""

from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import update

from server.accounts.identity import FRESH_FOR
from server.context import Services
from server.core.values import now
from server.models import Account, AccountLogin, AdminSession, Workspace
from tests.helpers.admins import PASSWORD, Admin, fresh_browser, signed_in
from tests.helpers.studies import Participant

CHANGES: list[tuple[str, str, Any]] = [
    ("POST", "/second-factor", None),
    ("PUT", "/second-factor", {"code": "123456"}),
    ("POST", "/tokens", {"name": "for ever", "scopes": ["export"], "days": 365}),
    ("DELETE", "/logins/1", None),
    ("POST", "/invitations", {"role": "owner"}),
    ("PATCH", "/accounts/1", {"disabled": True}),
    ("PUT", "/workspaces/careful", {"title": "Careful", "second_factor_required": False}),
]


def age(services: Services, by: timedelta) -> None:
    """As if every session had begun so long ago."""
    with services.database.write() as session:
        session.execute(update(AdminSession).values(created_at=now() - by))


@pytest.fixture
def stolen(owner: Admin, services: Services) -> Admin:
    """An owner's session of an hour ago, of an account with nothing but a login by a provider."""
    age(services, FRESH_FOR * 4)
    with services.database.write() as session:
        account = session.query(Account).one()
        account.password_hash = ""
        session.add(Workspace(name="careful", title="Careful", second_factor_required=True))
        session.execute(update(AdminSession).values(second_factor=True))
        session.add(
            AccountLogin(account_id=account.id, provider="uni", issuer="https://uni.example", subject="a")
        )
    return owner


@pytest.mark.parametrize(("method", "path", "body"), CHANGES)
def test_an_old_session_makes_no_way_in(stolen: Admin, method: str, path: str, body: Any) -> None:
    refused = stolen.send(method, path, body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (403, "sign_in_again")
    assert "15 minutes" in refused.json()["error"]["message"]
    assert stolen.get("/session").json()["account"]["second_factor"] is False
    assert (stolen.get("/tokens").json(), stolen.get("/invitations").json()) == ([], [])
    assert len(stolen.get("/logins").json()) == 1


def test_what_a_session_may_do_otherwise_it_may_go_on_doing(stolen: Admin) -> None:
    assert stolen.get("/accounts").status_code == 200
    assert stolen.get("/studies").status_code == 200
    same = {"title": "Careful people", "second_factor_required": True}
    assert stolen.send("PUT", "/workspaces/careful", same).status_code == 204


def test_signing_in_again_makes_it_fresh(owner: Admin, services: Services) -> None:
    age(services, FRESH_FOR * 4)
    assert owner.send("POST", "/second-factor").status_code == 403
    assert owner.send("POST", "/session", {"name": owner.name, "password": PASSWORD}).status_code == 200
    assert owner.send("POST", "/second-factor").status_code == 200


GRANTS: list[tuple[str, str, Any]] = [
    ("POST", "/studies/short/runs/{run}/erase", {"confirm": "{run}"}),
    ("PUT", "/studies/short/grants/bob", {"rights": ["view"]}),
    ("PUT", "/studies/short/workspace", {"workspace": "default"}),
    ("PUT", "/workspaces/default/members/bob", {"role": "owner"}),
]


@pytest.mark.parametrize(("method", "path", "body"), GRANTS)
def test_an_old_session_erases_nobody_and_grants_nothing(
    owner: Admin, participant: Participant, services: Services, method: str, path: str, body: Any
) -> None:
    signed_in(owner.client, services, "experimenter", "bob")
    participant.agree()
    run = participant.run_id
    body = {name: run if value == "{run}" else value for name, value in body.items()}
    age(services, FRESH_FOR * 4)
    refused = owner.send(method, path.format(run=run), body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (403, "sign_in_again")
    assert owner.get(f"/studies/short/runs/{run}").status_code == 200
    age(services, FRESH_FOR / 2)
    assert owner.send(method, path.format(run=run), body).status_code in (200, 204)


def test_a_token_that_may_change_still_erases(
    owner: Admin, participant: Participant, services: Services
) -> None:
    """A script of a panel that carries out requests under data protection law has no browser."""
    participant.agree()
    made = owner.send("POST", "/tokens", {"name": "panel", "scopes": ["write"]}).json()
    age(services, FRESH_FOR * 4)
    browser = fresh_browser(owner.client, services.settings)
    run = participant.run_id
    done = browser.post(
        f"/api/admin/studies/short/runs/{run}/erase",
        json={"confirm": run},
        headers={"authorization": f"Bearer {made['token']}"},
    )
    assert done.status_code == 200
