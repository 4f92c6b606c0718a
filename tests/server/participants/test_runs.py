import hashlib
import json
import uuid
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.models import Calibration, FormAnswer, RunEvent, Study, StudyRun
from tests.helpers.studies import Participant, StudyInDatabase, clip_url

CALIBRATION = {
    "px_per_mm": 3.8,
    "method": "card",
    "device_pixel_ratio": 2,
    "screen_width_px": 1440,
    "screen_height_px": 900,
    "window_width_px": 1440,
    "window_height_px": 800,
    "zoom": 1,
}


def error_code(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def test_the_page_gets_everything_but_the_cells(participant: Participant) -> None:
    state = participant.agree().state()
    assert (state["status"], state["stage"], state["origin"]) == ("active", "forms_before", "participant")
    assert state["texts"]["consent"] == "Do you agree?"
    assert state["blocks"] == [
        {"block": 0, "trials": 2},
        {"block": 1, "trials": 5},
        {"block": 2, "trials": 5},
    ]
    assert [trial["trial_index"] for trial in state["trials"]] == list(range(12))
    clip = state["trials"][0]
    assert (clip["frames"], clip["fps"], clip["width_mm"], clip["inter_ocular_px"]) == (4, 30, 120, 128)
    assert (clip["plays_done"], clip["plays_wanted"], clip["answered"]) == (0, 1, False)
    checks = [trial for trial in state["trials"] if trial["kind"] == "attention"]
    assert all(check["clip_sha256"] is None and "answer **" in check["prompt"] for check in checks)
    assert not {"slow", "fast", "cell", "levels", "expected_response"} & set(str(state["trials"]).split("'"))


def test_clips_are_where_the_page_expects_them(client: TestClient, participant: Participant) -> None:
    trial = participant.agree().state()["trials"][0]
    content = client.get(clip_url(trial)).content
    assert hashlib.sha256(content).hexdigest() == trial["clip_sha256"]


def test_the_answer_to_a_start_is_short(participant: Participant) -> None:
    """It grows with each trial: 166 of them are 91 KB, 16 KB gzipped."""
    trials = participant.agree().state()["trials"]
    assert max(len(json.dumps(trial, separators=(",", ":"))) for trial in trials) < 560


@pytest.mark.parametrize("header", [None, "Bearer nonsense", "Basic eA=="])
def test_without_its_token_a_run_is_closed_to_all(
    client: TestClient, study: StudyInDatabase, header: str | None
) -> None:
    answer = client.get("/api/run", headers={"authorization": header} if header else {})
    assert error_code(answer) == (401, "run_unknown")
    assert answer.headers["www-authenticate"] == "Bearer"


def test_nothing_is_stored_before_consent(participant: Participant) -> None:
    participant.start()
    trial = participant.state()["trials"][0]
    assert error_code(participant.rate(trial)) == (409, "consent_missing")
    assert error_code(participant.request("PUT", "/stage", {"stage": "trials"})) == (409, "consent_missing")
    form = participant.request("PUT", "/forms/about", {"answers": {"age": 30}})
    assert error_code(form) == (409, "consent_missing")


def test_who_does_not_agree_has_ended(participant: Participant) -> None:
    participant.start()
    assert participant.request("PUT", "/consent", {"agreed": False}).json()["status"] == "withdrawn"
    assert error_code(participant.request("PUT", "/consent", {"agreed": True})) == (409, "run_closed")


def test_calibrations_are_kept_and_the_latest_counts(participant: Participant, services: Services) -> None:
    participant.agree()
    for px_per_mm in (3.8, 4.1):
        answer = participant.request("PUT", "/calibration", {**CALIBRATION, "px_per_mm": px_per_mm})
        assert answer.status_code == 200
    assert participant.state()["calibration"]["px_per_mm"] == 4.1
    with services.database.read() as session:
        assert session.query(Calibration).count() == 2
        assert session.query(StudyRun).one().px_per_mm == 4.1


def test_form_answers_are_checked_and_replaced(participant: Participant, services: Services) -> None:
    participant.agree()
    for answers in ({"age": 30, "glasses": ["lenses"]}, {"age": 31, "glasses": []}):
        assert participant.request("PUT", "/forms/about", {"answers": answers}).status_code == 200
    assert participant.state()["answered_forms"] == ["about"]
    with services.database.read() as session:
        assert session.query(FormAnswer).one().answers == {"age": 31}


@pytest.mark.parametrize(
    ("answers", "field"),
    [
        ({}, "age"),
        ({"age": 17}, "age"),
        ({"age": True}, "age"),
        ({"age": "30"}, "age"),
        ({"age": 30, "glasses": ["monocle"]}, "glasses"),
        ({"age": 30, "glasses": ["lenses", "lenses"]}, "glasses"),
        ({"age": 30, "glases": []}, "glases"),
    ],
)
def test_answers_that_do_not_fit(participant: Participant, answers: dict[str, Any], field: str) -> None:
    participant.agree()
    answer = participant.request("PUT", "/forms/about", {"answers": answers})
    assert error_code(answer) == (422, "form_invalid")
    assert list(answer.json()["error"]["details"]["fields"]) == [field]


def test_an_undeclared_form(participant: Participant) -> None:
    participant.agree()
    answer = participant.request("PUT", "/forms/abuot", {"answers": {}})
    assert error_code(answer) == (404, "form_unknown")
    assert "did you mean 'about'" in answer.json()["error"]["message"]


def test_stage_language_and_device_are_stored(participant: Participant, services: Services) -> None:
    participant.agree()
    assert participant.request("PUT", "/stage", {"stage": "practice"}).json()["stage"] == "practice"
    assert participant.request("PUT", "/stage", {"stage": "lunch"}).status_code == 422
    assert participant.request("PUT", "/language", {"language": "de"}).status_code == 200
    assert error_code(participant.request("PUT", "/language", {"language": "fr"})) == (
        422,
        "language_unknown",
    )
    participant.request("PUT", "/device", {"webcodecs": True})
    participant.request("PUT", "/device", {"refresh_rate_hz": 59.9})
    assert participant.state()["texts"]["debrief"] == "Danke."
    with services.database.read() as session:
        assert session.query(StudyRun).one().device == {"webcodecs": True, "refresh_rate_hz": 59.9}


def test_events_are_stored_once_also_after_the_end(participant: Participant, services: Services) -> None:
    participant.agree()
    event = {"id": str(uuid.uuid4()), "type": "focus_lost", "at": "2026-11-21T01:00:00Z", "data": {"n": 1}}
    for _ in range(2):
        answer = participant.request("POST", "/events", {"events": [event]})
        assert answer.json() == {"received": 1}
    participant.request("POST", "/withdraw")
    late = {**event, "id": str(uuid.uuid4()), "at": "2026-11-21T01:00:00"}
    assert participant.request("POST", "/events", {"events": [late]}).status_code == 200
    with services.database.read() as session:
        assert session.query(RunEvent).count() == 2
    many = {"events": [{**event, "id": str(uuid.uuid4())} for _ in range(101)]}
    assert participant.request("POST", "/events", many).status_code == 422


@pytest.mark.parametrize("type", ["screened_out", "warned", "answer_refused", "answer_expired"])
def test_a_page_cannot_write_the_servers_own_events(
    participant: Participant, services: Services, type: str
) -> None:
    participant.agree()
    event = {"id": str(uuid.uuid4()), "type": type, "at": None, "data": {"rule": "warnings"}}
    answer = participant.request("POST", "/events", {"events": [event]})
    assert error_code(answer) == (422, "event_reserved")
    with services.database.read() as session:
        assert session.query(RunEvent).count() == 0


def test_completion_waits_for_every_trial(participant: Participant) -> None:
    participant.agree()
    trials = participant.state()["trials"]
    answer = participant.request("POST", "/complete")
    assert error_code(answer) == (409, "ratings_missing")
    assert answer.json()["error"]["details"]["missing"] == [trial["trial_index"] for trial in trials]


def test_completion_waits_for_the_required_forms(participant: Participant) -> None:
    participant.agree()
    participant.rate_all()
    answer = participant.request("POST", "/complete")
    assert error_code(answer) == (409, "forms_missing")
    assert answer.json()["error"]["details"]["missing"] == ["about"]
    assert "about" in answer.json()["error"]["message"]
    participant.answer_forms()
    assert participant.request("POST", "/complete").json()["status"] == "complete"


def test_completion_gives_the_same_code_each_time(participant: Participant) -> None:
    participant.agree()
    participant.answer_all()
    answers = [participant.request("POST", "/complete").json() for _ in range(2)]
    assert answers[0] == answers[1]
    assert len(answers[0]["completion_code"]) == 10
    assert answers[0]["redirect_url"] is None
    state = participant.state()
    assert (state["status"], state["stage"]) == ("complete", "debrief")
    assert participant.request("PUT", "/stage", {"stage": "done"}).status_code == 200


@pytest.mark.parametrize("honest", [True, False])
def test_codes_and_redirects_of_a_recruiter(client: TestClient, study: StudyInDatabase, honest: bool) -> None:
    recruiter = {"kind": "prolific", "code_complete": "GOOD1", "code_failed_check": "BAD1"}
    participant = Participant(client, study.link(recruiter=recruiter))
    participant.start(query={"PROLIFIC_PID": "5f1a9c0e7b2d3c4e5f6a7b8c"})
    participant.request("PUT", "/consent", {"agreed": True})
    trials = participant.state()["trials"]
    for trial in [trial for trial in trials if trial["kind"] == "attention"] if not honest else []:
        asked = int(trial["prompt"].split("**")[1])
        assert participant.rate(trial, asked % 7 + 1).status_code == 201
    participant.answer_all()
    answer = participant.request("POST", "/complete").json()
    code = "GOOD1" if honest else "BAD1"
    assert answer["completion_code"] == code
    assert answer["redirect_url"] == f"https://app.prolific.com/submissions/complete?cc={code}"


def test_a_study_closes_itself_when_enough_are_complete(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    study.change(quota=1)
    participant = Participant(client, study.link_token).agree()
    participant.answer_all()
    participant.request("POST", "/complete")
    with services.database.read() as session:
        assert session.query(Study).one().status == "closed"
    assert error_code(Participant(client, study.link_token).start()) == (409, "study_closed")


def test_a_closed_study_lets_those_inside_finish(client: TestClient, study: StudyInDatabase) -> None:
    participant = Participant(client, study.link_token).agree()
    study.change(status="closed")
    participant.answer_all()
    assert participant.request("POST", "/complete").status_code == 200


def test_who_withdraws_gets_no_code_and_stores_nothing_more(participant: Participant) -> None:
    participant.agree()
    trial = participant.state()["trials"][0]
    assert participant.request("POST", "/withdraw").json()["status"] == "withdrawn"
    assert error_code(participant.rate(trial)) == (409, "run_closed")
    assert error_code(participant.request("POST", "/complete")) == (409, "run_closed")


def test_one_participant_cannot_reach_anothers_run(client: TestClient, study: StudyInDatabase) -> None:
    first, second = (Participant(client, study.link_token).agree() for _ in range(2))
    first.rate(first.state()["trials"][0])
    assert not second.state()["trials"][0]["answered"]
    assert first.state()["run_id"] != second.state()["run_id"]
