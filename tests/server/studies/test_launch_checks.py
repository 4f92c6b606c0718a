"""What is found before a study goes live."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.level_leaks import reported_leaks
from experiments.manifest import Manifest
from server.context import Services
from server.core.settings import Settings
from server.models import Study, StudyVersion
from tests.helpers.admins import Admin
from tests.helpers.databases import run_server_command
from tests.helpers.motion_checks import checked
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study


def test_levels_told_apart_by_something_else_are_named_before_going_live(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", status="draft")
    assert _told_apart(owner) == []
    with services.database.write() as session:
        version = session.query(StudyVersion).one()
        clips = [
            clip | {"closure": [0.0, 1.0, 0.0 if clip["levels"]["speed"] == "slow" else 0.1]}
            for clip in version.manifest["clips"]
        ]
        version.manifest = version.manifest | {"clips": clips}
        expected = reported_leaks(Manifest.model_validate(version.manifest).clips)
    answer = _told_apart(owner)
    assert expected
    assert [check["text"].lower() for check in answer] == [f"{text}.".lower() for text in expected]
    assert all("'speed'" in check["text"] and not check["blocks"] for check in answer)


def _told_apart(admin: Admin) -> list[Any]:
    found = admin.get("/studies/short/launch-checks").json()
    return [check for check in found if check["kind"] == "levels_told_apart"]


CONSENT = '"Do you agree?"'
PLACEHOLDERS = '"# [Title]\\n\\nA study on [topic]. Responsible: [name]."'
PERSON = "5f3c2a1b4d6e7f8091a2b3c4"


def opened(admin: Admin, name: str = "short", status: str = "live") -> Any:
    revision = admin.get(f"/studies/{name}").json()["summary"]["revision"]
    return admin.send("PUT", f"/studies/{name}/status", {"revision": revision, "status": status})


def recruiting(admin: Admin, recruiter: dict[str, str] | None) -> Any:
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "paused": False, "quota": None, "recruiter": recruiter}
    return admin.send("PUT", "/studies/short/settings", body)


def blocking(admin: Admin) -> list[str]:
    return [check["text"] for check in admin.get("/studies/short/launch-checks").json() if check["blocks"]]


@pytest.mark.parametrize("language", ["en", "de"])
def test_a_text_with_unfilled_placeholders_does_not_go_live(
    owner: Admin, services: Services, tmp_path: Path, language: str
) -> None:
    first = CONSENT if language == "en" else '"Einverstanden?"'
    add_study(services, tmp_path / "clips", SHORT.replace(first, PLACEHOLDERS), status="draft")
    [text] = blocking(owner)
    assert f"texts.{language}.consent" in text
    assert "[Title], [topic], [name]" in text
    refused = opened(owner)
    assert refused.status_code == 409
    assert text in refused.json()["error"]["message"]
    assert opened(owner, status="pilot").status_code == 200
    assert opened(owner).status_code == 409
    assert owner.get("/studies/short").json()["summary"]["status"] == "pilot"


def test_no_later_version_of_a_live_study_brings_placeholders(owner: Admin, study: StudyInDatabase) -> None:
    revision = owner.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "toml": SHORT.replace(CONSENT, PLACEHOLDERS)}
    refused = owner.send("POST", "/studies/short/versions", body)
    assert refused.status_code == 409
    assert "[topic]" in refused.text
    assert owner.get("/studies/short").json()["summary"]["version"] == 1


def test_the_command_line_refuses_it_too(services: Services, settings: Settings, tmp_path: Path) -> None:
    add_study(services, tmp_path / "clips", SHORT.replace(CONSENT, PLACEHOLDERS), status="draft")
    refused = run_server_command(settings, "study", "status", "short", "live")
    assert "[topic]" in refused.stdout + refused.stderr
    with services.database.read() as session:
        assert session.query(Study).one().status == "draft"


def test_prolific_without_its_completion_code_does_not_go_live(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", status="draft")
    assert recruiting(owner, {"kind": "prolific"}).status_code == 200
    [text] = blocking(owner)
    assert "completion code" in text
    assert opened(owner).status_code == 409
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1ABC"}).status_code == 200
    assert blocking(owner) == []
    assert opened(owner).status_code == 200
    assert recruiting(owner, {"kind": "prolific"}).status_code == 409
    link = {"kind": "general", "recruiter": {"kind": "prolific"}}
    assert owner.send("POST", "/studies/short/links", link).status_code == 409


def test_a_recruiter_that_is_not_set_is_named_and_its_links_begin_no_visit(
    owner: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    kinds = [check["kind"] for check in owner.get("/studies/short/launch-checks").json()]
    assert "recruiter" in kinds
    for query in ({"PROLIFIC_PID": PERSON}, {"survey_code": "12"}, {"workerId": "A1B2C3D4E5"}):
        refused = Participant(client, study.link_token).start(query=query)
        assert refused.status_code == 409
        assert refused.json()["error"]["code"] == "recruiter_not_set"
    study.change(recruiter={"kind": "prolific", "code_complete": "C1ABC"})
    assert Participant(client, study.link_token).start(query={"PROLIFIC_PID": PERSON}).status_code == 201
    again = Participant(client, study.link_token).start(query={"PROLIFIC_PID": PERSON})
    assert again.status_code == 409
    kinds = [check["kind"] for check in owner.get("/studies/short/launch-checks").json()]
    assert "recruiter" not in kinds


def test_texts_without_a_translation_are_named_and_do_not_block(owner: Admin, study: StudyInDatabase) -> None:
    [check] = [
        check for check in owner.get("/studies/short/launch-checks").json() if check["kind"] == "translations"
    ]
    assert "de" in check["text"]
    assert "forms.1.title" in check["text"]
    assert not check["blocks"]


def advice(admin: Admin, kind: str) -> list[str]:
    found = admin.get("/studies/short/launch-checks").json()
    return [check["text"] for check in found if check["kind"] == kind]


@pytest.mark.parametrize(
    ("attention", "advised"), [("per_block = 1", False), ("per_block = 0", True)], ids=["two", "none"]
)
def test_recruiting_for_a_study_without_enough_checks_recommends_them(
    owner: Admin, services: Services, tmp_path: Path, attention: str, advised: bool
) -> None:
    text = SHORT.replace("[attention]\nper_block = 1", f"[attention]\n{attention}")
    add_study(services, tmp_path / "clips", text, status="draft")
    assert advice(owner, "person_checks") == []
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1"}).status_code == 200
    assert bool(advice(owner, "person_checks")) == advised


def test_motion_checks_that_the_consent_does_not_mention_are_warned_of(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    add_study(services, tmp_path / "clips", checked(SHORT), status="draft")
    (warning,) = advice(owner, "flicker")
    assert "(en, de)" in warning


def test_the_switch_for_online_recruitment_is_what_is_recommended(
    owner: Admin, services: Services, tmp_path: Path
) -> None:
    text = SHORT.replace("[attention]\nper_block = 1\n", "[evidence]\nonline_recruitment = true\n")
    text = text.replace(CONSENT, '"Some clips flicker. Do you agree?"')
    text = text.replace('"Einverstanden?"', '"Einige Clips flimmern. Einverstanden?"')
    add_study(services, tmp_path / "clips", text, status="draft")
    assert recruiting(owner, {"kind": "prolific", "code_complete": "C1"}).status_code == 200
    assert advice(owner, "person_checks") == advice(owner, "flicker") == []
