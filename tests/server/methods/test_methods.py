"""The Methods paragraph: its counts are those of the runs, and each names the query that gives it."""

import json
import re
import uuid
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import text

from server.accounts.identity import OPERATOR
from server.context import Services
from server.methods.paragraph import Methods
from server.methods.repository import Number
from server.methods.service import methods_of
from server.runs.erasure import erase
from server.studies.lookup import find_study
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.server.trials.test_motion_checks import answered, checked, of_kind, right_answers


def taken_part(client: TestClient, study: StudyInDatabase) -> None:
    """Two complete visits, one begun, one withdrawn; a fifth person only looked."""
    for _ in range(2):
        person = Participant(client, study.link_token).agree()
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    Participant(client, study.link(recruiter={"kind": "sona"})).start(query={"survey_code": "7"})
    gone = Participant(client, study.link("personal", label="P1")).agree()
    gone.request("POST", "/withdraw")


def test_erased_visits_are_no_withdrawals_and_other_origins_are_named(
    client: TestClient, study: StudyInDatabase, viewer: Admin, services: Services
) -> None:
    taken_part(client, study)
    person = Participant(client, study.link_token).agree()
    with services.database.write() as session:
        known = find_study(session, study.name, OPERATOR, "edit")
        erase(session, services.settings, known, person.run_id, person.run_id, OPERATOR)
    answer = viewer.get("/studies/short/methods").json()
    numbers = {one["name"]: one["value"] for one in answer["numbers"]}
    assert (numbers["withdrew"], numbers["erased"]) == (1, 1)
    assert "Erased afterwards, answers and consent with them: 1." in answer["paragraph"]
    assert "no data of participants" not in answer["paragraph"]
    simulated = viewer.get("/studies/short/methods?origin=simulated").json()["paragraph"]
    assert simulated.startswith("These visits are no data of participants: their origin is 'simulated'.")


def test_the_counts_are_those_of_the_runs(
    client: TestClient, study: StudyInDatabase, viewer: Admin, services: Services
) -> None:
    taken_part(client, study)
    answer = viewer.get("/studies/short/methods").json()
    numbers = {one["name"]: one["value"] for one in answer["numbers"]}
    assert {name: numbers[name] for name in ("begun", "agreed", "complete", "withdrew", "unfinished")} == {
        "begun": 4,
        "agreed": 3,
        "complete": 2,
        "withdrew": 1,
        "unfinished": 1,
    }
    assert (numbers["by_recruiter"], numbers["by_personal_link"]) == (1, 1)
    assert (numbers["plays"], numbers["checks"]) == (16, 4)
    assert numbers["plays"] == sum(
        numbers[f"plays_{verdict}"] for verdict in ("good", "uncertain", "flagged", "failed")
    )
    assert "2 were completed" in answer["paragraph"]
    assert "Every clip was drawn frame by frame" in answer["paragraph"]
    assert "Automated answers: tickets" in answer["paragraph"]
    assert "Nobody has completed" not in answer["paragraph"]
    assert "and 1 was left open" in answer["paragraph"]
    assert "attention checks failed" in answer["paragraph"]
    with services.database.read() as session:  # as somebody who doubts a number would
        declared = [one for one in answer["numbers"] if one["source"].startswith("declaration: ")]
        assert {one["name"]: one["value"] for one in declared} == {
            "attention_per_block": 1,
            "motion_checks_per_block": 0,
        }
        for one in answer["numbers"]:
            if one in declared:
                continue
            assert session.scalar(text(one["source"])) == one["value"], one["name"]


def test_every_number_of_the_text_has_its_source_below(
    client: TestClient, study: StudyInDatabase, viewer: Admin
) -> None:
    taken_part(client, study)
    paragraph, sources = viewer.get("/studies/short/methods/methods.txt").text.split("\n\n")
    marks = {int(mark) for mark in re.findall(r"\d+ \[(\d+)\]", paragraph)}
    assert marks == {int(line[1 : line.index("]")]) for line in sources.splitlines()}
    assert not re.findall(r"[{}]", paragraph)


def test_a_report_adds_what_each_declared_rule_left_out(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    taken_part(client, study)
    runs = [{"participant": "p1", "run": "r1", "reasons": ["attention_checks_failed: 3 failed"]}] * 2
    trials = [{"rule": "slow_trials", "trials": 9, "participants": 2}]
    results = {"exclusions": {"runs": runs, "trials": trials}}
    with services.database.read() as session:
        found = methods_of(
            session, find_study(session, "short", OPERATOR, "view"), "participant", None, results
        )
    assert "visits by attention checks failed: 2; trials by slow trials: 9" in found.plain()
    assert json.loads(found.json())["paragraph"] == found.plain()


def test_nobody_has_taken_part_yet(viewer: Admin, study: StudyInDatabase) -> None:
    paragraph = viewer.get("/studies/short/methods").json()["paragraph"]
    assert "Visits begun: 0" in paragraph
    assert "Nobody has completed a visit yet" in paragraph
    assert not re.search("was drawn|plays|not judged|was calibrated", paragraph)


def test_other_origins_and_series_are_not_counted(
    client: TestClient, study: StudyInDatabase, viewer: Admin
) -> None:
    taken_part(client, study)
    assert "Visits begun: 0" in viewer.get("/studies/short/methods?origin=pilot").json()["paragraph"]
    assert viewer.get("/studies/short/methods?series=7").status_code == 404


@given(st.text(alphabet="ab&%$#_~\\", max_size=20))
def test_latex_has_no_sign_that_means_something(words: str) -> None:
    numbers = {"n": Number("n", 3, "SELECT 3")}
    made: Any = Methods("s", "participant", 1, (f"x {words} {{n}}",), numbers).latex().splitlines()[1]
    bare = re.sub(r"\\textbackslash\{\}|\\textasciitilde\{\}|\\[&%$#_{}]", "", made)
    assert not set(bare) & set("&%$#_{}~\\")


def test_motion_checks_are_told_with_how_many_were_right(
    client: TestClient, services: Services, tmp_path: Path, viewer: Admin
) -> None:
    study = add_study(services, tmp_path / "clips", checked(SHORT))
    right = right_answers(services, "short")
    asked = 0
    for takes_other_way in (False, True):
        person = Participant(client, study.link_token).agree()
        first, second, *others = of_kind(person.state(), "check")
        asked += 2 + len(others)
        if takes_other_way:
            body = {"answer": {"kind": "check", "check": None, "other_way": True}}
            body |= {"trial_index": first["trial_index"], "playback": {"method": "none"}}
            assert person.request("PUT", f"/ratings/{uuid.uuid4()}", body).status_code == 201
        else:
            assert answered(person, first, right[first["clip_sha256"]]).status_code == 201
        assert answered(person, second, right[second["clip_sha256"]]).status_code == 201
        for trial in others:
            assert answered(person, trial, right[trial["clip_sha256"]] % 4 + 1).status_code == 201
        person.answer_all()
        assert person.request("POST", "/complete").status_code == 200
    numbers = {one["name"]: one["value"] for one in viewer.get("/studies/short/methods").json()["numbers"]}
    assert {name: value for name, value in numbers.items() if name.startswith("motion")} == {
        "motion_checks_per_block": 2,
        "motion_checks": asked - 1,
        "motion_checks_right": 3,
        "motion_checks_other_way": 1,
    }
    with services.database.read() as session:
        declared_study = find_study(session, "short", OPERATOR, "view")
        written = methods_of(session, declared_study, "participant", None).latex()
    assert "motion alone (digit, direction)" in written
    assert "% motion\\_checks" not in written
    assert "% motion_checks_right = 3: SELECT count(*)" in written
    assert "% motion_checks_per_block = 2: declaration: evidence.motion_checks.per_block" in written
