"""Every endpoint with every foreign object as everybody: refused, and nothing said of what is there.

The endpoints come from the routers and their OpenAPI description: a new one is tested without a line here,
or fails here until it is said what a foreign object of its kind is, and which right it needs.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute
from fastapi.testclient import TestClient

from server.accounts import workspaces
from server.accounts.identity import OPERATOR
from server.app import _routers
from server.context import Services
from server.core.errors import NotFound
from server.models import RIGHTS, AccountLogin, Job, Right
from server.studies.links import create_link
from server.studies.lookup import find_study
from server.studies.uploads import upload_folder
from tests.helpers.admins import Admin, signed_in
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

ADMIN = "/api/admin"
STUDY = f"{ADMIN}/studies/{{study}}"
Endpoint = tuple[str, str]
OUTSIDERS = ("owner elsewhere", "experimenter elsewhere", "viewer elsewhere", "nowhere", "administrator")
OWN: set[str] = {
    f"{ADMIN}/invitations/{{token}}",
    f"{ADMIN}/blinks/strips/{{name}}",
    f"{ADMIN}/experiments/{{experiment}}/builds",
    f"{ADMIN}/session/providers/{{provider}}",
}
"""Beginnings of paths whose parameter is the caller's secret, or a file that is everybody's."""
ADMINISTRATORS = ("accounts", "invitations", "audit", "workspaces", "backups")
"""What the administrator of the server sees of all laboratories: not one of their answers."""
NEEDED: dict[Right, set[str]] = {
    "view": {
        "GET ",
        "POST versions/check",
        "GET versions/{number}",
        "GET clips",
        "GET launch-checks",
        "GET originals/{sha256}",
        "GET originals/{sha256}/frame-map.csv",
        "GET monitor",
        "GET monitor/stream",
        "GET failing-clips",
        "GET warnings",
        "GET results",
        "GET data/analysis.{language}",
        "GET data/codebook.md",
        "GET reports",
        "GET rehearsals/latest",
        "GET rehearsals/{rehearsal}",
        "GET rehearsals/{rehearsal}/report/{file}",
        "GET capsules",
        "GET methods",
        "GET methods/methods.txt",
        "GET comparison",
        "GET retention",
        "GET seal",
        "GET seal/plan.{ending}",
    },
    "run": {
        "PUT status",
        "PUT settings",
        "GET links",
        "POST links",
        "GET links/personal.csv",
        "DELETE links/{link}",
        "PUT runs/{run}/exclusion",
        "DELETE runs/{run}/exclusion",
        "POST reports",
        "POST rehearsals",
        "POST rehearsals/{rehearsal}/cancel",
        "PUT archive",
        "POST capsules",
        "DELETE capsules/{capsule}",
    },
    "edit": {
        "DELETE ",
        "POST versions",
        "POST runs/{run}/erase",
        "POST copies",
        "POST seal",
        "GET drafts",
        "PUT drafts/{tab}",
        "DELETE drafts/{tab}",
        "POST editors/{tab}",
    },
    "export": {
        "GET runs",
        "GET runs/{run}",
        "GET runs/{run}/evidence",
        "GET runs/{run}/replay",
        "GET runs/{run}/replay/trials/{trial_index}",
        "GET data/ratings.csv",
        "GET data/wide.csv",
        "GET data/runs.csv",
        "GET data/raw.ndjson",
        "GET data/psych-ds.zip",
        "GET data/{table}.{ending}",
        "GET reports/{report}/{file}",
        "GET capsules/{capsule}.zip",
    },
    "own": {
        "GET runs/{run}/identity",
        "GET runs/{run}/subject-access",
        "GET data/identities.csv",
        "GET links/signing",
        "GET grants",
        "PUT grants/{account}",
        "PUT workspace",
    },
}
"""Which right an endpoint of a study needs, said a second time and by hand."""
BODIES: dict[str, Any] = {
    "ChangeSettings": {"revision": 1, "paused": False, "quota": None, "recruiter": None},
}
"""Where the smallest body that fits the schema is not found by `smallest`."""


@dataclass
class Laboratory:
    """A laboratory with a study, a participant and everything else that has an address."""

    study: StudyInDatabase
    addresses: dict[str, str]
    secrets: tuple[str, ...]


@pytest.fixture
def application(client: TestClient) -> FastAPI:
    app = client.app
    assert isinstance(app, FastAPI)
    return app


@pytest.fixture
def foreign(client: TestClient, services: Services, study: StudyInDatabase) -> Laboratory:
    person = Participant(client, study.link_token).agree()
    owner = signed_in(client, services, "owner")
    token = owner.send("POST", "/tokens", {"name": "theirs", "scopes": ["read"]}).json()["id"]
    invitation = owner.send("POST", "/invitations", {"role": "viewer", "label": "for Zoe"}).json()["id"]
    with services.database.write() as session:
        found = find_study(session, study.name, OPERATOR, "view")
        link = create_link(session, services.settings.key, found, "personal", label="Mrs Miller").public_id
        session.add(Job(public_id="f" * 32, kind="report", study_id=found.id, status="done", message=""))
        # One under way, so that no test starts a real one.
        session.add(Job(public_id="e" * 32, kind="report", study_id=found.id, status="queued", message=""))
        session.add(Job(public_id="d" * 32, kind="capsule", study_id=found.id, status="queued", message=""))
    account = owner.get("/session").json()["account"]["id"]
    with services.database.write() as session:
        row = AccountLogin(
            account_id=account, provider="uni", issuer="https://x", subject="1", label="Ada L."
        )
        session.add(row)
        session.flush()
        login = row.id
        session.add(Job(public_id="b" * 32, kind="rehearsal", study_id=found.id, status="queued", message=""))
    folder = services.settings.data_folder / "reports" / ("f" * 32)
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("their report")
    upload = owner.client.post(f"{ADMIN}/uploads").json()["id"]
    addresses = {
        "study": study.name, "run": person.run_id, "link": link, "report": "f" * 32, "file": "report.html",
        "number": "1", "workspace": "default", "account": "the owner", "account_id": str(account),
        "session_id": str(owner.get("/sessions").json()[0]["id"]), "token_id": str(token),
        "invitation_id": str(invitation), "table": "ratings", "ending": "sav", "language": "R",
        "upload": upload, "capsule": "d" * 32, "sha256": "c" * 64,
        "provider": "uni", "login_id": str(login), "trial_index": "0", "rehearsal": "b" * 32, "tab": "tab-1",
    }  # fmt: skip
    title = study.experiment.title
    return Laboratory(
        study, addresses, (title, person.run_id, link, "Mrs Miller", "for Zoe", "their report", "Ada L.")
    )


@pytest.fixture
def outsiders(client: TestClient, services: Services, foreign: Laboratory, tmp_path) -> dict[str, Admin]:
    """People of another laboratory, somebody of none, and the administrator of the server, of none either."""
    found = {name: signed_in(client, services, "viewer", name) for name in OUTSIDERS}
    own = SHORT.replace("A short study", "A study of our own")
    add_study(services, tmp_path / "own clips", own, name="own")
    with services.database.write() as session:
        elsewhere = workspaces.create(session, "elsewhere", "Another laboratory", OPERATOR)
        workspaces.move(session, find_study(session, "own", OPERATOR, "own"), elsewhere, OPERATOR)
        home = workspaces.find_workspace(session, "default")
        for name in OUTSIDERS:
            workspaces.set_member(session, home, name, None, OPERATOR)
        for role in ("owner", "experimenter", "viewer"):
            workspaces.set_member(session, elsewhere, f"{role} elsewhere", role, OPERATOR)
        workspaces.account_named(session, "administrator").role = "owner"
    return found


def endpoints(application: FastAPI) -> Iterator[tuple[Endpoint, Any]]:
    """Every endpoint under /api/admin with its description."""
    described = application.openapi()["paths"]
    for router in _routers():
        for route in router.routes:
            if isinstance(route, APIRoute) and route.path.startswith(ADMIN):
                for method in sorted(route.methods):
                    assert route.include_in_schema, f"{route.path} is not described"
                    yield (method, route.path), described[route.path][method.lower()]


def smallest(schema: dict[str, Any], known: dict[str, Any]) -> Any:
    """A small value that fits a schema of this API."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return BODIES[name] if name in BODIES else smallest(known[name], known)
    if "enum" in schema:
        return schema["enum"][0]
    if "anyOf" in schema:
        return smallest(schema["anyOf"][0], known)
    if schema.get("type") == "object":
        return {name: smallest(schema["properties"][name], known) for name in schema.get("required", [])}
    if schema.get("type") == "array":
        return [smallest(schema["items"], known) for _ in range(schema.get("minItems", 0))]
    if schema.get("type") == "boolean":
        return False
    return 1 if schema.get("type") in ("integer", "number") else "x" * max(1, schema.get("minLength", 1))


def ask(who: Admin, endpoint: Endpoint, about: Any, addresses: dict[str, str], known: dict[str, Any]) -> Any:
    """Send the smallest request that fits an endpoint."""
    method, path = endpoint
    missing = [name for name in names_in(path) if name not in addresses]
    assert not missing, f"say in `foreign` what a foreign {missing[0]} of {path} is"
    content = about.get("requestBody", {}).get("content", {}).get("application/json")
    body = smallest(content["schema"], known) if content else None
    query = {
        one["name"]: smallest(one["schema"], known)
        for one in about.get("parameters", [])
        if one["in"] == "query" and one["required"]
    }
    words = {
        one["name"]: one["schema"]["enum"][0]
        for one in about.get("parameters", [])
        if one["in"] == "path" and "enum" in one["schema"]
    }
    return who.client.request(method, path.format(**addresses | words), json=body, params=query)


def names_in(path: str) -> list[str]:
    return [part.split("}")[0] for part in path.split("{")[1:]]


@pytest.mark.parametrize("outsider", OUTSIDERS)
def test_nobody_from_outside_gets_at_a_foreign_object_or_hears_that_there_is_one(
    application: FastAPI, foreign: Laboratory, outsiders: dict[str, Admin], outsider: str
) -> None:
    who, known = outsiders[outsider], application.openapi()["components"]["schemas"]
    nothing = foreign.addresses | {"study": "a" * len(foreign.study.name)}
    asked = 0
    for endpoint, about in endpoints(application):
        method, path = endpoint
        if not names_in(path) or any(path.startswith(own) for own in OWN):
            continue
        if outsider == "administrator" and path.removeprefix(f"{ADMIN}/").startswith(ADMINISTRATORS):
            continue
        answer = ask(who, endpoint, about, foreign.addresses, known)
        assert answer.status_code in (403, 404), f"{method} {path} as {outsider}: {answer.text[:300]}"
        assert not [secret for secret in foreign.secrets if secret in answer.text], (endpoint, answer.text)
        asked += 1
        if path.startswith(STUDY):
            other = ask(who, endpoint, about, nothing, known)
            said = answer.text.replace(foreign.study.name, nothing["study"])
            assert (other.status_code, other.text) == (answer.status_code, said), endpoint
    assert asked > 40 or (outsider == "administrator" and asked > 35)


@pytest.mark.parametrize("outsider", OUTSIDERS)
def test_lists_hold_nothing_foreign(
    application: FastAPI, foreign: Laboratory, outsiders: dict[str, Admin], outsider: str
) -> None:
    for (method, path), _ in endpoints(application):
        if method != "GET" or names_in(path):
            continue
        if outsider == "administrator" and path.removeprefix(f"{ADMIN}/").startswith(ADMINISTRATORS):
            continue
        answer = outsiders[outsider].client.get(path)
        for secret in (*foreign.secrets, "the owner", f'"{foreign.study.name}"'):
            if "blinks" not in path and "experiments" not in path:
                assert secret not in answer.text, (path, secret)


def test_a_foreign_object_is_not_reached_through_a_study_of_ones_own(
    application: FastAPI, foreign: Laboratory, outsiders: dict[str, Admin]
) -> None:
    who, known = outsiders["owner elsewhere"], application.openapi()["components"]["schemas"]
    tried = 0
    for endpoint, about in endpoints(application):
        if set(names_in(endpoint[1])) & {"run", "link", "report"}:
            answer = ask(who, endpoint, about, foreign.addresses | {"study": "own"}, known)
            assert answer.status_code == 404, (endpoint, answer.text)
            tried += 1
    assert tried >= 6


@pytest.mark.parametrize("granted", [right for right in RIGHTS if right != "own"])
def test_a_right_opens_what_it_is_for_and_nothing_else(
    application: FastAPI, services: Services, foreign: Laboratory, outsiders: dict[str, Admin], granted: Right
) -> None:
    known = application.openapi()["components"]["schemas"]
    with services.database.write() as session:
        found = find_study(session, foreign.study.name, OPERATOR, "own")
        workspaces.grant(session, found, "experimenter elsewhere", [granted], OPERATOR)
    listed = {one for right in NEEDED.values() for one in right}
    for endpoint, about in endpoints(application):
        method, path = endpoint
        if not path.startswith(STUDY):
            continue
        short = f"{method} {path.removeprefix(STUDY).removeprefix('/')}"
        assert short in listed, f"say in NEEDED which right {short} needs"
        if short.endswith("/stream"):  # it would not end
            continue
        [needed] = [right for right, those in NEEDED.items() if short in those]
        answer = ask(outsiders["experimenter elsewhere"], endpoint, about, foreign.addresses, known)
        refused = answer.status_code == 403 and answer.json()["error"]["code"] == "not_allowed"
        assert refused == (needed not in ("view", granted)), (short, granted, answer.text[:300])


def test_who_may_only_look_and_download_changes_nothing() -> None:
    """A viewer of a workspace has the rights to view and to export."""
    reading = {f"{right}: {one}" for right in ("view", "export") for one in NEEDED[right]}
    changing = {one for one in reading if ": GET " not in one}
    assert changing == {"view: POST versions/check"}, "asks what a version would change, and stores nothing"


def test_a_foreign_study_is_not_compared_with_ones_own(outsiders: dict[str, Admin]) -> None:
    asked = "/studies/own/comparison?old=1&new=1&other="
    owner = outsiders["owner elsewhere"]
    assert (owner.get(f"{asked}short").status_code, owner.get(f"{asked}own").status_code) == (404, 200)


def test_an_upload_is_its_senders_alone(services: Services, outsiders: dict[str, Admin], tmp_path) -> None:
    clip = next((tmp_path / "own clips").glob("*.mp4"))
    sent = outsiders["owner elsewhere"].client.post(
        f"{ADMIN}/uploads", files={"files": (clip.name, clip.read_bytes())}
    )
    assert sent.status_code == 201, sent.text
    body = {"name": "taken", "upload": sent.json()["id"], "levels": {"pattern": "{a}_{b}_{exemplar}.mp4"}}
    answer = outsiders["experimenter elsewhere"].send("POST", "/studies", body)
    assert (answer.status_code, answer.json()["error"]["code"]) == (404, "not_found")


def test_an_upload_from_before_uploads_had_senders_is_sent_again(tmp_path: Path) -> None:
    (tmp_path / ("a" * 32)).mkdir()
    with pytest.raises(NotFound, match="Please upload the clips again"):
        upload_folder(tmp_path, "a" * 32, 1)


def test_a_person_taken_out_of_a_workspace_is_out_at_once(
    services: Services, outsiders: dict[str, Admin]
) -> None:
    viewer = outsiders["viewer elsewhere"]
    assert viewer.get("/studies/own").status_code == 200
    owner = outsiders["owner elsewhere"]
    assert owner.send("DELETE", "/workspaces/elsewhere/members/viewer elsewhere").status_code == 204
    assert viewer.get("/studies/own").status_code == 404
    assert viewer.get("/studies").json() == []
