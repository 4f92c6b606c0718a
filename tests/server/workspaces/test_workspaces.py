"""Workspaces: who moves in when there were none, second factors, moves, owners, and the command line."""

import pyotp
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.accounts import workspace_repository, workspaces
from server.accounts.identity import OPERATOR
from server.accounts.service import add_account
from server.context import Services, open_services
from server.core.db import Database
from server.core.migrate import current_revision, downgrade, newest_revision, upgrade
from server.core.settings import Settings
from server.studies.lookup import find_study
from tests.helpers.admins import PASSWORD, Admin, signed_in
from tests.helpers.databases import BACKENDS
from tests.helpers.studies import StudyInDatabase, add_study

BEFORE = "0021"
both = pytest.mark.parametrize("empty_database_url", BACKENDS, indirect=True)


@pytest.fixture
def filled(empty_database_url: str, tmp_path) -> Services:
    """Accounts of each role and a study."""
    services = open_services(Settings(database_url=empty_database_url, data_folder=tmp_path, secret_key="x"))
    upgrade(services.database)
    with services.database.write() as session:
        for role in ("viewer", "experimenter", "owner"):
            add_account(session, role, "hash", role)
    add_study(services, tmp_path / "clips")
    return services


def standing(database: Database) -> list[tuple[str, str, str]]:
    query = (
        "SELECT w.name, a.name, m.role FROM workspace_members m JOIN workspaces w ON w.id = m.workspace_id "
    )
    with database.read() as session:
        rows = session.execute(text(query + "JOIN accounts a ON a.id = m.account_id ORDER BY a.id"))
        return [(row[0], row[1], row[2]) for row in rows]


@both
def test_whoever_had_an_account_moves_in_with_the_rights_she_had(filled: Services) -> None:
    downgrade(filled.database, BEFORE)
    assert current_revision(filled.database) == BEFORE
    upgrade(filled.database)
    assert standing(filled.database) == [
        ("default", role, role) for role in ("viewer", "experimenter", "owner")
    ]
    with filled.database.read() as session:
        study = find_study(session, "short", OPERATOR, "view")
        home = workspace_repository.workspace_of(session, study)
        assert home is not None
        assert (home.name, home.second_factor_required) == ("default", False)
    filled.database.close()


@both
def test_no_way_back_where_it_would_open_a_laboratory_to_others(filled: Services) -> None:
    with filled.database.write() as session:
        workspaces.create(session, "elsewhere", "Elsewhere", OPERATOR)
    with pytest.raises(RuntimeError, match="and 1 others and 0 accounts") as raised:
        downgrade(filled.database, BEFORE)
    assert "\n" not in str(raised.value)
    assert current_revision(filled.database) == newest_revision()
    filled.database.close()


def test_a_workspace_that_asks_for_a_second_factor_is_closed_without_one(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    viewer = signed_in(client, services, "viewer")
    wanted = {"title": "Laboratory", "second_factor_required": True}
    refused = owner.send("PUT", "/workspaces/default", wanted)
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "conflict")
    secret = owner.send("POST", "/second-factor").json()["secret"]
    assert owner.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).status_code == 200
    assert owner.send("PUT", "/workspaces/default", wanted).status_code == 204
    assert owner.get("/studies/short").status_code == 200
    shut = viewer.get("/studies/short")
    assert (shut.status_code, shut.json()["error"]["code"]) == (403, "second_factor_needed")
    assert viewer.get("/studies").json() == []
    assert viewer.get("/session").json()["workspaces"][0]["second_factor_needed"] is True
    assert owner.send("DELETE", "/second-factor", {"password": PASSWORD}).status_code == 204
    assert owner.get("/studies/short").status_code == 403


def test_who_manages_the_server_needs_the_second_factor_of_a_workspace_too(
    services: Services, owner: Admin
) -> None:
    with services.database.write() as session:
        workspaces.create(session, "locked", "Locked", OPERATOR).second_factor_required = True
    wanted = {"title": "Opened", "second_factor_required": False}
    for method, path, body in (
        ("PUT", "/workspaces/locked", wanted),
        ("GET", "/workspaces/locked/members", None),
        ("PUT", "/workspaces/locked/members/the owner", {"role": "owner"}),
        ("DELETE", "/workspaces/locked", None),
    ):
        refused = owner.send(method, path, body)
        assert (refused.status_code, "second factor" in refused.text) == (403, True), (method, path)
    secret = owner.send("POST", "/second-factor").json()["secret"]
    assert owner.send("PUT", "/second-factor", {"code": pyotp.TOTP(secret).now()}).status_code == 200
    assert owner.send("PUT", "/workspaces/locked", wanted).status_code == 204


def test_a_copy_lands_next_to_its_source_or_where_the_copier_says(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    owner.send("POST", "/workspaces", {"name": "new-lab", "title": "New"})
    other = signed_in(client, services, "experimenter", "other")
    with services.database.write() as session:
        home = workspaces.find_workspace(session, "default")
        found = find_study(session, "short", OPERATOR, "own")
        workspaces.set_member(session, home, "other", None, OPERATOR)
        new = workspaces.find_workspace(session, "new-lab")
        workspaces.set_member(session, new, "other", "experimenter", OPERATOR)
        workspaces.grant(session, found, "other", ["edit"], OPERATOR)
    refused = other.send("POST", "/studies/short/copies", {"name": "copy"})
    assert (refused.status_code, "new-lab" in refused.text, "default" in refused.text) == (422, True, False)
    foreign = other.send("POST", "/studies/short/copies", {"name": "copy", "workspace": "default"})
    assert foreign.status_code == 404
    assert other.get("/studies/copy").status_code == 404
    taken = other.send("POST", "/studies/short/copies", {"name": "copy", "workspace": "new-lab"})
    assert (taken.status_code, taken.json()["summary"]["workspace"]) == (201, "new-lab")
    beside = owner.send("POST", "/studies/short/copies", {"name": "beside"})
    assert beside.json()["summary"]["workspace"] == "default"
    elsewhere = owner.send("POST", "/studies/short/copies", {"name": "further", "workspace": "new-lab"})
    assert elsewhere.json()["summary"]["workspace"] == "new-lab"
    with services.database.write() as session:
        workspaces.set_member(session, workspaces.find_workspace(session, "new-lab"), "other", None, OPERATOR)
    nowhere = other.send("POST", "/studies/short/copies", {"name": "nowhere"})
    assert (nowhere.status_code, "you do not have it in any" in nowhere.text) == (403, True)


def test_one_owner_of_a_workspace_must_remain(owner: Admin) -> None:
    assert owner.send("DELETE", "/workspaces/default/members/the owner").status_code == 409
    assert owner.send("PUT", "/workspaces/default/members/the owner", {"role": "viewer"}).status_code == 409


def test_a_study_moves_and_its_old_people_lose_it(
    client: TestClient, services: Services, owner: Admin, study: StudyInDatabase
) -> None:
    viewer = signed_in(client, services, "viewer")
    assert owner.send("POST", "/workspaces", {"name": "new-lab", "title": "New"}).status_code == 201
    assert owner.send("PUT", "/studies/short/workspace", {"workspace": "new-lab"}).status_code == 204
    assert viewer.get("/studies/short").status_code == 404
    assert owner.get("/studies/short").json()["summary"]["workspace"] == "new-lab"
    assert owner.send("PUT", "/studies/short/grants/the viewer", {"rights": ["view"]}).status_code == 204
    assert viewer.get("/studies/short").json()["summary"]["rights"] == ["view"]
    assert owner.get("/studies/short/grants").json() == [{"account": "the viewer", "rights": ["view"]}]
    assert [one["account"] for one in owner.get("/workspaces/new-lab/members").json()] == ["the owner"]
    assert [one["studies"] for one in owner.get("/workspaces").json()] == [0, 1]
    assert owner.send("DELETE", "/workspaces/new-lab").status_code == 409
    rows = [(row["actor"], row["action"], row["target"]) for row in owner.get("/audit").json()]
    assert rows[:4] == [
        (owner.name, "rights granted", "short"),
        (viewer.name, "refused", "short"),  # who asked for it meanwhile
        (owner.name, "study moved", "short"),
        (owner.name, "workspace made", "new-lab"),
    ]


def test_an_invitation_leads_into_the_workspace_it_names(
    client: TestClient, services: Services, owner: Admin
) -> None:
    owner.send("POST", "/workspaces", {"name": "new-lab", "title": "New"})
    wanted = {"role": "viewer", "workspace": "new-lab", "workspace_role": "owner"}
    token = owner.send("POST", "/invitations", wanted).json()["url"].rsplit("#", 1)[1]
    made = client.post(f"/api/admin/invitations/{token}/account", json={"name": "head", "password": PASSWORD})
    belongs = [(one["name"], one["role"]) for one in made.json()["workspaces"]]
    assert (made.json()["account"]["role"], belongs) == ("viewer", [("new-lab", "owner")])
    unknown = owner.send("POST", "/invitations", {"role": "viewer", "workspace": "new-lad"})
    assert unknown.status_code == 404
    assert "new-lab" in unknown.json()["error"]["message"]
