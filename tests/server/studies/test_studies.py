"""Definitions, versions and links of studies; clips of shipped experiments, built in the background."""

import time
import tomllib
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.load import parse_experiment
from server.context import Services
from server.results import demo_builds
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase
from tests.helpers.tiny_clips import make_clip_folder
from tests.helpers.uploads import upload


def test_a_definition_is_checked_with_lines(experimenter: Admin) -> None:
    checked = experimenter.send(
        "POST", "/definitions/check", {"toml": SHORT.replace("per_cell", "per_cel")}
    ).json()
    assert checked["design"] is None
    assert "did you mean 'per_cell'?" in checked["problems"][0]["message"]
    assert checked["problems"][0]["line"] == 17
    assert (
        experimenter.send("POST", "/definitions/check", {"toml": SHORT}).json()["design"]["unique_clips"] == 8
    )


def test_text_that_is_not_toml_has_no_data_and_takes_none(experimenter: Admin) -> None:
    read = experimenter.send("POST", "/definitions/edit", {"toml": "name = = 1\n"}).json()
    assert (read["data"], read["problems"][0]["line"]) == (None, 1)
    answer = experimenter.send("POST", "/definitions/edit", {"toml": "name = ", "data": {"name": "a"}})
    assert (answer.status_code, "not valid TOML" in answer.json()["error"]["message"]) == (422, True)


def test_edited_texts_become_a_version_and_runs_keep_theirs(
    experimenter: Admin, study: StudyInDatabase, participant: Participant
) -> None:
    participant.agree()
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    data = tomllib.loads(SHORT)
    data["texts"]["en"]["consent"] = "Do you really agree?"
    edited = experimenter.send("POST", "/definitions/edit", {"toml": SHORT, "data": data}).json()
    assert (edited["problems"], edited["data"], edited["design"]["unique_clips"]) == ([], data, 8)
    body = {"revision": revision, "toml": edited["toml"]}
    changed = experimenter.send("POST", "/studies/short/versions", body)
    assert changed.status_code == 201, changed.text
    assert [version["number"] for version in changed.json()["versions"]] == [2, 1]
    assert changed.json()["definition"]["texts"]["en"]["consent"] == "Do you really agree?"
    assert participant.state()["texts"]["consent"] == "Do you agree?"
    assert experimenter.get("/studies/short/versions/1").text.strip() == SHORT.strip()


def test_two_people_editing_at_once_get_a_message(experimenter: Admin, study: StudyInDatabase) -> None:
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    settings = {"paused": True, "quota": 20, "recruiter": None}
    assert (
        experimenter.send("PUT", "/studies/short/settings", {"revision": revision} | settings).status_code
        == 200
    )
    late = experimenter.send("PUT", "/studies/short/settings", {"revision": revision} | settings)
    assert (late.status_code, late.json()["error"]["code"]) == (409, "edited_meanwhile")


def test_a_changed_design_that_its_clips_do_not_fit_is_refused(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    toml = SHORT.replace("per_cell = 2", "per_cell = 3")
    answer = experimenter.send("POST", "/studies/short/versions", {"revision": revision, "toml": toml})
    assert answer.status_code == 422
    assert "4 are missing from the manifest" in answer.json()["error"]["message"]


PAIRS = """kind = "paired_comparison"
question = { en = "Which?", de = "Welcher?" }
presentation = { arrangement = "side_by_side", gap_mm = 8.0, if_too_narrow = "stack" }
pairs = { among = "declared", cells = [{ cell = "a/slow", other = "a/fast" }, CELLS] }
"""
NEVER_COMPARED = SHORT.replace(
    SHORT[SHORT.index('kind = "clip') : SHORT.index("[[exclusions]]")],
    PAIRS.replace("CELLS", '{ cell = "b/slow", other = "b/fast" }'),
).replace('split_by = "character"\norder = "alternating"', "")


def test_a_design_whose_clips_are_never_compared_is_not_saved(
    experimenter: Admin, study: StudyInDatabase, tmp_path: Path
) -> None:
    make_clip_folder(parse_experiment(NEVER_COMPARED), tmp_path / "built")
    files = {path.name: path.read_bytes() for path in (tmp_path / "built").iterdir()}
    uploaded = upload(experimenter, *files.items()).json()["id"]
    answers = [
        experimenter.send("POST", "/studies", {"name": "p", "upload": uploaded, "toml": NEVER_COMPARED}),
        experimenter.send("POST", "/studies/short/versions/check", {"toml": NEVER_COMPARED}),
        experimenter.send("POST", "/studies/short/versions", {"revision": 1, "toml": NEVER_COMPARED}),
    ]
    for answer in answers:
        assert answer.status_code == 422, answer.text
        assert answer.json()["error"]["message"].startswith(
            "definition: line 31: trial: expected pairs that connect all items, got 2 groups never compared "
            "with one another: {a/fast, a/slow} and {b/fast, b/slow}. Declare a pair between them"
        )
    [summary] = experimenter.get("/studies").json()
    assert (summary["name"], summary["version"]) == ("short", 1)


def test_a_closed_study_takes_nobody(
    experimenter: Admin, study: StudyInDatabase, participant: Participant
) -> None:
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]
    body = {"revision": revision, "status": "closed"}
    assert experimenter.send("PUT", "/studies/short/status", body).json()["summary"]["status"] == "closed"
    refused = participant.start()
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "study_closed")
    back = experimenter.send("PUT", "/studies/short/status", {"revision": revision + 1, "status": "draft"})
    assert back.status_code == 409


def test_personal_links_are_made_at_once_and_listed(experimenter: Admin, study: StudyInDatabase) -> None:
    made = experimenter.send(
        "POST", "/studies/short/links", {"kind": "personal", "count": 3, "label": "S"}
    ).json()
    assert [link["label"] for link in made] == ["S001", "S002", "S003"]
    table = experimenter.get("/studies/short/links/personal.csv").text.splitlines()
    assert table[0] == "label,url,runs,complete,group"
    assert len(table) == 4
    assert experimenter.send("DELETE", f"/studies/short/links/{made[0]['id']}").status_code == 204
    token = made[0]["url"].rpartition("/")[2]
    assert Participant(experimenter.client, token).start().status_code == 404


def test_a_preview_stores_nothing_that_counts(experimenter: Admin, study: StudyInDatabase) -> None:
    [link] = experimenter.send("POST", "/studies/short/links", {"kind": "preview"}).json()
    person = Participant(experimenter.client, link["url"].rpartition("/")[2])
    assert person.start().status_code == 201
    assert experimenter.get("/studies/short/runs").json() == {"runs": [], "total": 0, "next": None}
    assert experimenter.get("/studies/short").json()["summary"]["active"] == 0


def test_only_an_untouched_draft_can_be_deleted(
    experimenter: Admin, study: StudyInDatabase, participant: Participant
) -> None:
    assert experimenter.send("DELETE", "/studies/short").status_code == 409
    study.change(status="draft")
    assert experimenter.send("DELETE", "/studies/short").status_code == 204
    assert experimenter.get("/studies").json() == []


def test_an_edit_is_judged_before_it_is_saved(
    experimenter: Admin, study: StudyInDatabase, participant: Participant
) -> None:
    participant.agree()
    revision = experimenter.get("/studies/short").json()["summary"]["revision"]

    def judged(toml: str) -> dict[str, Any]:
        answer = experimenter.send("POST", "/studies/short/versions/check", {"toml": toml})
        assert answer.status_code == 200, answer.text
        return answer.json()

    same = judged(SHORT)
    assert same == {"changes": [], "series": 1, "present_series": 1, "runs": 1, "begins_series": False}
    worded = judged(SHORT.replace("Do you agree?", "Do you really agree?"))
    assert [change["effect"] for change in worded["changes"]] == ["wording"]
    assert (worded["series"], worded["begins_series"]) == (1, False)
    shorter = SHORT.replace("[trial.scale]\n", "[trial.scale]\nmaximum = 5\n")
    assert shorter != SHORT
    measured = judged(shorter)
    assert measured["changes"][0] | {"text": ""} == {
        "path": "trial.scale.maximum",
        "effect": "measured",
        "text": "",
    }
    assert measured["changes"][0]["text"] == "trial.scale.maximum: 7 becomes 5"
    assert (measured["series"], measured["runs"], measured["begins_series"]) == (2, 1, True)
    assert experimenter.get("/studies/short").json()["summary"]["revision"] == revision
    saved = experimenter.send("POST", "/studies/short/versions", {"revision": revision, "toml": shorter})
    assert saved.json()["series"][-1]["number"] == measured["series"]
    assert judged(SHORT)["begins_series"] is False


def test_an_edit_that_cannot_be_used_is_refused_with_its_line(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    wrong = {"toml": SHORT.replace("per_cell", "per_cel")}
    answer = experimenter.send("POST", "/studies/short/versions/check", wrong)
    assert answer.status_code == 422
    assert "per_cell" in answer.json()["error"]["message"]


def test_shipped_experiments_say_whether_their_clips_are_built(viewer: Admin, services: Services) -> None:
    folder = services.settings.stimuli_folder
    (folder / "sliders-demo").mkdir(parents=True)
    (folder / "sliders-demo" / "manifest.json").write_text("{}")
    shipped = {one["name"]: one for one in viewer.get("/experiments").json()}
    assert shipped["sliders-demo"]["clips_ready"]
    demo = shipped["pairs-demo"]
    assert (demo["demonstration"], demo["clips_ready"]) == (True, False)
    assert not shipped["exp1"]["demonstration"]


def test_a_build_that_fails_says_why_and_can_be_asked_for_again(
    experimenter: Admin, viewer: Admin, services: Services
) -> None:
    services.settings.stimuli_folder.mkdir(parents=True, exist_ok=True)
    (services.settings.stimuli_folder / "dcr-demo").write_text("a file where the folder of clips belongs")
    assert viewer.get("/experiments/builds").json() == {"lacks": "", "builds": []}
    assert viewer.send("POST", "/experiments/dcr-demo/builds", {}).status_code == 403
    for _ in range(2):
        begun = experimenter.send("POST", "/experiments/dcr-demo/builds", {})
        assert (begun.status_code, begun.json()["status"]) == (202, "queued")
        other = experimenter.send("POST", "/experiments/pairs-demo/builds", {})
        assert other.status_code == 409
        assert "'dcr-demo' are being built" in other.json()["error"]["message"]
        [build] = _ended_builds(viewer)
        assert (build["experiment"], build["status"]) == ("dcr-demo", "failed")
        assert "dcr-demo" in build["message"]
        assert "Traceback" not in build["message"]


def test_of_two_builds_asked_for_at_once_one_begins(experimenter: Admin, services: Services) -> None:
    with services.locks.held(demo_builds.KIND):  # as the other request holds it between its look and its job
        refused = experimenter.send("POST", "/experiments/dcr-demo/builds")
    assert (refused.status_code, _ended_builds(experimenter)) == (409, [])
    assert "being built" in refused.json()["error"]["message"]


def _ended_builds(viewer: Admin) -> list[dict[str, str]]:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        builds: list[dict[str, str]] = viewer.get("/experiments/builds").json()["builds"]
        if all(build["status"] not in {"queued", "running"} for build in builds):
            return builds
        time.sleep(0.2)
    raise AssertionError("the build did not end within a minute")


def test_a_server_that_cannot_render_says_so(experimenter: Admin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo_builds, "RENDERS_WITH", "a_module_that_is_not_installed")
    lacks = experimenter.get("/experiments/builds").json()["lacks"]
    assert lacks.startswith("This server cannot render clips.")
    refused = experimenter.send("POST", "/experiments/dcr-demo/builds", {})
    assert (refused.status_code, refused.json()["error"]["message"]) == (409, lacks)
    assert experimenter.send("POST", "/experiments/nothing/builds", {}).status_code == 404


COMMENTS = """
[[forms]]
name = "comments"
when = "after"
title = { en = "Comments" }
[[forms.fields]]
type = "text"
name = "remark"
label = { en = "Anything else?" }
"""


def _saved_series(admin: Admin, toml: str) -> int:
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    saved = admin.send("POST", "/studies/short/versions", {"revision": revision, "toml": toml})
    assert saved.status_code < 300, saved.text
    newest = max(saved.json()["versions"], key=lambda version: version["number"])
    return int(newest["series"])


def test_a_comments_form_after_the_last_trial_keeps_the_data_series(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    assert _saved_series(experimenter, SHORT + COMMENTS) == 1
    # It is new to the first version, but another question than that of the second.
    likert = 'type = "likert"\nlow = { en = "no" }\nhigh = { en = "yes" }'
    assert _saved_series(experimenter, SHORT + COMMENTS.replace('type = "text"', likert)) == 2
    assert _saved_series(experimenter, SHORT + COMMENTS) == 1


def test_the_list_says_who_made_a_study_and_what_goes_on_in_it(
    owner: Admin, client: TestClient, study: StudyInDatabase
) -> None:
    for _ in range(2):
        person = Participant(client, study.link_token).agree()
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    preview = Participant(client, study.link("preview")).agree()
    preview.answer_all()
    assert preview.request("POST", "/complete").status_code == 200
    assert owner.send("POST", "/studies/short/copies", {"name": "copied", "version": 1}).status_code == 201
    copied, short = owner.get("/studies").json()
    assert (copied["name"], copied["completed_by_day"]) == ("copied", [0] * 14)
    assert copied["owner"] == owner.get("/session").json()["account"]["name"]
    assert copied["last_activity"] >= copied["created_at"]
    assert (short["owner"], short["completed_by_day"]) == ("", [0] * 13 + [2])
    assert short["last_activity"] > short["created_at"]
