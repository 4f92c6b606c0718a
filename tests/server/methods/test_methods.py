"""The Methods paragraph: its counts are those of the runs, and each names the query that gives it."""

import json
import re
import uuid
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import text

from experiments.rules.screening import ScreenFormAnswer
from server.accounts.identity import OPERATOR
from server.context import Services
from server.privacy.erasures import erase
from server.results.methods import methods_of
from server.results.methods_clauses import Methods
from server.results.methods_repository import Number
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


def test_erased_visits_are_not_withdrawals_and_other_origins_are_named(
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
    assert "The data of one visit, including answers and consent, were erased later." in answer["paragraph"]
    assert "not data from participants" not in answer["paragraph"]
    simulated = viewer.get("/studies/short/methods?origin=simulated").json()["paragraph"]
    assert simulated.startswith("These visits are not data from participants: their origin is 'simulated'.")


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
    assert "Four participants began the study; three consented, and two completed it." in answer["paragraph"]
    assert "Every clip was drawn frame by frame" in answer["paragraph"]
    assert (
        "To detect automated answers, server tickets with server times (in zero visits)"
        in answer["paragraph"]
    )
    assert "No participant has completed" not in answer["paragraph"]
    assert "and one was unfinished or still in progress" in answer["paragraph"]
    study.change(status="closed")
    closed = viewer.get("/studies/short/methods").json()["paragraph"]
    assert "and one was not finished." in closed
    assert "declared before data collection: a failed attention check." in answer["paragraph"]
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
    marks = {int(mark) for mark in re.findall(r"\w+ \[(\d+)\]", paragraph)}
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
    said = "excluded two visits for a failed attention check; nine trials for slow trials."
    assert said in found.plain()
    assert json.loads(found.json())["paragraph"] == found.plain()


def test_rules_of_one_name_are_counted_once_and_both_limits_are_named(
    client: TestClient, study: StudyInDatabase, owner: Admin, services: Services
) -> None:
    late = '[[exclusions]]\nrule = "slow_trials"\nabove_ms = '
    twice = f"{late}9000\n{late}4000\n"
    save_version(owner, SHORT + "\n" + twice)
    complete(client, study.link_token)
    both = ["attention_checks_failed: 3 failed", "attention_checks_failed: 3 failed"]
    trials = [{"rule": "slow_trials", "trials": n, "participants": 1} for n in (9, 2)]
    results = {"exclusions": {"runs": [{"participant": "p", "run": "r", "reasons": both}], "trials": trials}}
    with services.database.read() as session:
        study_row = find_study(session, "short", OPERATOR, "view")
        said = methods_of(session, study_row, "participant", None, results).plain()
    assert "one visit for a failed attention check" in said
    both_late = "an answer more than 9 s after the clip or an answer more than 4 s after the clip"
    assert f"11 trials for {both_late}." in said


def test_an_answer_with_braces_is_no_number_of_the_text() -> None:
    rule = ScreenFormAnswer(form="who", field="sport", refused=("{other}", "{begun}"))
    assert rule.reason() == "the answer (other) or (begun) to 'sport' of the form 'who'"


def test_nobody_has_taken_part_yet(viewer: Admin, study: StudyInDatabase) -> None:
    paragraph = viewer.get("/studies/short/methods").json()["paragraph"]
    assert "Zero participants began the study" in paragraph
    assert "No participant has completed the study yet" in paragraph
    assert not re.search("was drawn|presentations|verified|was calibrated", paragraph)


def test_other_origins_and_series_are_not_counted(
    client: TestClient, study: StudyInDatabase, viewer: Admin
) -> None:
    taken_part(client, study)
    assert (
        "Zero participants began the study"
        in viewer.get("/studies/short/methods?origin=pilot").json()["paragraph"]
    )
    assert viewer.get("/studies/short/methods?series=7").status_code == 404


@given(st.text(alphabet="ab&%$#_~\\", max_size=20))
def test_latex_has_no_sign_that_means_something(words: str) -> None:
    numbers = {"n": Number("n", 3, "SELECT 3")}
    made: Any = Methods("s", "participant", 1, (f"x {words} {{n}}",), numbers).latex().splitlines()[1]
    bare = re.sub(r"\\textbackslash\{\}|\\textasciitilde\{\}|\\[&%$#_{}]", "", made)
    assert not set(bare) & set("&%$#_{}~\\")


def test_motion_checks_are_reported_with_how_many_were_right(
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
    assert "motion only (digit, direction)" in written
    assert "% motion\\_checks" not in written
    assert "% motion_checks_right = 3: SELECT count(*)" in written
    assert "% motion_checks_per_block = 2: declaration: evidence.motion_checks.per_block" in written


def paragraph(viewer: Admin, **query: Any) -> str:
    return str(viewer.get("/studies/short/methods", params=query).json()["paragraph"])


def values(viewer: Admin, services: Services, **query: Any) -> dict[str, int]:
    """The numbers of the paragraph; each is what its own query gives."""
    numbers = viewer.get("/studies/short/methods", params=query).json()["numbers"]
    with services.database.read() as session:
        for one in numbers:
            if not one["source"].startswith("declaration: "):
                assert session.scalar(text(one["source"])) == one["value"], one["name"]
    return {one["name"]: one["value"] for one in numbers}


def complete(client: TestClient, link: str, **start: Any) -> Participant:
    person = Participant(client, link)
    assert person.start(**start).status_code == 201
    assert person.request("PUT", "/consent", {"agreed": True}).status_code == 200
    person.answer_all()
    assert person.request("POST", "/complete").status_code == 200
    return person


def save_version(admin: Admin, toml: str) -> None:
    revision = admin.get("/studies/short").json()["summary"]["revision"]
    saved = admin.send("POST", "/studies/short/versions", {"revision": revision, "toml": toml})
    assert saved.status_code < 300, saved.text


PROLIFIC = {"kind": "prolific", "code_complete": "C1ABC"}
PERSON = "5f3c2a1b4d6e7f8091a2b3c4"
MORE_RULES = """
[[exclusions]]
rule = "median_response_time"

[[screening]]
rule = "form_answer"
form = "about"
field = "age"
below = 18
"""


def test_only_visits_that_a_recruiter_sent_were_recruited_through_it(
    client: TestClient, study: StudyInDatabase, viewer: Admin, services: Services
) -> None:
    complete(client, study.link_token)
    complete(client, study.link(synthetic=True))
    study.change(recruiter=PROLIFIC)
    assert "Prolific" not in paragraph(viewer)
    complete(client, study.link_token, query={"PROLIFIC_PID": PERSON})
    complete(client, study.link_token)
    complete(client, study.link("personal", label="P1"))
    assert "One participant was recruited through Prolific." in paragraph(viewer)
    study.change(recruiter={"kind": "sona"})
    assert "One participant was recruited through Prolific." in paragraph(viewer)
    assert "SONA" not in paragraph(viewer)
    complete(client, study.link(recruiter={"kind": "sona"}), query={"survey_code": "7"})
    assert "One participant was recruited through SONA." in paragraph(viewer)
    assert values(viewer, services)["begun"] == 5
    assert "recruited" not in paragraph(viewer, origin="simulated")


def test_every_clip_was_drawn_only_where_every_play_was(
    client: TestClient, study: StudyInDatabase, viewer: Admin, services: Services
) -> None:
    complete(client, study.link_token)
    said = paragraph(viewer)
    assert "Every clip was drawn frame by frame in the participant's browser and each frame's time" in said
    assert "flagged" not in said
    person = Participant(client, study.link_token).agree()
    mains = [trial for trial in person.state()["trials"] if trial["kind"] == "main"]
    person.rate(mains[0], None, playback={"method": "none", "clip_sha256": None, "drawn": None})
    person.rate(mains[0], play=2)
    person.rate(mains[1], playback={"method": "video", "clock_gap_ms": None, "drawn": None})
    person.rate(mains[2], playback={"frames_missing": 1, "frames_drawn": 3})
    person.rate(mains[3], playback={"disturbances": {"clip_scaled_down": 1}})
    person.answer_all()
    assert person.request("POST", "/complete").status_code == 200
    said = paragraph(viewer)
    assert "Every clip" not in said
    assert "frame's time" not in said
    assert (
        "drawn frame by frame in 15, shown by the browser's video element in one, and not shown at all "
        "in one." in said
    )
    assert "three were flagged (" in said
    assert "missing frames: one" in said
    assert "clip scaled down: one" in said
    found = values(viewer, services)
    assert (found["plays"], found["plays_by_frame"], found["plays_not_drawn"]) == (17, 15, 1)


def test_rules_are_declared_before_the_data_only_where_every_visit_had_them(
    client: TestClient, study: StudyInDatabase, viewer: Admin, owner: Admin, services: Services
) -> None:
    complete(client, study.link_token)
    save_version(owner, SHORT + MORE_RULES)
    later = "declared or changed after one visit had begun: a median response time below 200 ms."
    said = paragraph(viewer)
    assert "exclusion were declared before data collection: a failed attention check." in said
    assert later in said
    assert "reasons for screening" not in said
    complete(client, study.link_token)
    said = paragraph(viewer)
    assert later in said
    assert "screening applied to one of two visits: the answer " in said
    assert values(viewer, services)["begun_with_2"] == 1
    # Another limit is another rule: the data were there when it was chosen.
    save_version(
        owner, SHORT.replace('"attention_checks_failed"', '"attention_checks_failed"\nmore_than = 1')
    )
    said = paragraph(viewer)
    assert "before data collection" not in said.replace("No exclusion rule was declared before", "")
    assert "changed after two visits had begun: 2 or more failed attention checks." in said


def test_a_number_of_checks_that_was_changed_is_not_stated_as_one(
    client: TestClient, study: StudyInDatabase, viewer: Admin, owner: Admin
) -> None:
    assert "Attention was checked" not in paragraph(viewer)
    complete(client, study.link_token)
    one = "with one instructed-response item per block; completed visits contained two answers"
    assert one in paragraph(viewer)
    save_version(owner, SHORT.replace("per_block = 1", "per_block = 2"))
    assert one in paragraph(viewer)
    complete(client, study.link_token)
    assert one not in paragraph(viewer)
    assert "their number per visit was changed (2, 4); completed visits contained six answers" in paragraph(
        viewer
    )


def test_warnings_that_nobody_got_were_not_given(
    client: TestClient, study: StudyInDatabase, viewer: Admin, owner: Admin
) -> None:
    save_version(owner, SHORT + '\n[[warnings.rules]]\nrule = "same_answer"\nanswers = 20\n')
    complete(client, study.link_token)
    said = paragraph(viewer)
    assert "were warned" not in said
    assert "Warnings about same answer were declared, but no participant was warned." in said


def test_who_declined_or_began_again_did_not_wish_to_end(
    client: TestClient, services: Services, tmp_path: Path, viewer: Admin
) -> None:
    again = SHORT.replace("lease_minutes = 60", 'lease_minutes = 60\nresume = "restart"')
    study = add_study(services, tmp_path / "clips", again)
    declines = Participant(client, study.link_token)
    declines.start()
    declines.request("PUT", "/consent", {"agreed": False})
    person = Participant(client, study.link_token).agree()
    assert person.start().status_code == 201
    said = paragraph(viewer)
    found = values(viewer, services)
    assert (found["declined"], found["restarted"], found["withdrew"]) == (1, 1, 0)
    assert "one ended because consent was declined" in said
    assert "one was replaced by a new visit of the same participant" in said


def test_an_empty_series_says_where_the_data_are(
    client: TestClient, study: StudyInDatabase, viewer: Admin, owner: Admin
) -> None:
    for _ in range(3):
        complete(client, study.link_token)
    save_version(owner, SHORT.replace("[trial.scale]\n", "[trial.scale]\nmaximum = 9\n"))
    said = paragraph(viewer)
    assert said.startswith("3 participants are in series 1 (version 1); data series 2 has no visits yet.")
    assert "Zero participants began" not in said
    assert "Three participants began" in paragraph(viewer, series=1)


@pytest.mark.parametrize("people", [1, 2])
def test_one_and_several_have_their_own_words(
    client: TestClient, study: StudyInDatabase, viewer: Admin, people: int
) -> None:
    for _ in range(people):
        complete(client, study.link_token)
    said = paragraph(viewer)
    wrong = r"\b1 (were|visits|plays|answers)\b|\b(0|[2-9]|\d\d+) (was|visit|play|answer)\b"
    assert not re.search(wrong, said), said
