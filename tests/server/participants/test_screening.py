"""Runs that end as screened out: by an answer, by attention checks, by browser or screen."""

import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.models import RunEvent, StudyRun
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

RULES = """
[[screening]]
rule = "form_answer"
form = "about"
field = "age"
above = 65

[[screening]]
rule = "form_answer"
form = "about"
field = "glasses"
refused = ["lenses"]

[[screening]]
rule = "attention_checks_failed"
more_than = 1
"""
DEVICE = '[[screening]]\nrule = "device"\n'
Screened = Callable[..., Participant]


@pytest.fixture
def screened(client: TestClient, services: Services, tmp_path: Path) -> Screened:
    """Makes a participant, after consent, of a study with these screening rules."""
    made: list[StudyInDatabase] = []

    def make(rules: str = RULES, **link: Any) -> Participant:
        if not made:
            text = SHORT.replace("[texts.en]", rules + "\n[texts.en]").replace('"short"', '"screened"')
            made.append(add_study(services, tmp_path / "clips", text))
        return Participant(client, made[0].link(**link)).agree()

    return make


def error_code(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def reasons(services: Services) -> list[dict[str, Any]]:
    with services.database.read() as session:
        return [event.data for event in session.query(RunEvent).filter_by(type="screened_out")]


@pytest.mark.parametrize(
    ("answers", "field"),
    [
        ({"age": 66}, "age"),
        ({"age": 65, "glasses": ["glasses", "lenses"]}, "glasses"),
        ({"age": 65, "glasses": ["glasses"]}, None),
        ({"age": 65}, None),
    ],
)
def test_an_answer_ends_the_run(
    screened: Screened, services: Services, answers: dict[str, Any], field: str | None
) -> None:
    participant = screened()
    saved = participant.request("PUT", "/forms/about", {"answers": answers}).json()
    assert saved["status"] == ("screened_out" if field else "active")
    found = [{"rule": "form_answer", "form": "about", "field": field}] if field else []
    assert reasons(services) == found
    assert participant.state()["answered_forms"] == ["about"]  # why a person left is kept


def test_who_is_screened_out_stores_nothing_more_and_frees_the_slot(
    screened: Screened, services: Services
) -> None:
    first = screened()
    trial = first.state()["trials"][0]
    first.request("PUT", "/forms/about", {"answers": {"age": 90}})
    assert error_code(first.rate(trial)) == (409, "run_closed")
    assert first.request("PUT", "/stage", {"stage": "trials"}).json()["stage"] == "forms_before"
    assert error_code(first.request("PUT", "/forms/about", {"answers": {"age": 40}})) == (409, "run_closed")
    screened()
    with services.database.read() as session:
        runs = session.query(StudyRun).order_by(StudyRun.id).all()
        assert [(run.status, run.slot, run.stage) for run in runs] == [
            ("screened_out", 0, "forms_before"),
            ("active", 0, "forms_before"),
        ]


def test_failed_attention_checks_end_the_run_and_the_receipt_says_so(
    screened: Screened, services: Services
) -> None:
    participant = screened()
    checks = [trial for trial in participant.state()["trials"] if trial["kind"] == "attention"]
    wrong = [int(check["prompt"].split("**")[1]) % 7 + 1 for check in checks]
    ids = [str(uuid.uuid4()) for _ in checks]
    statuses = [
        participant.rate(check, answer, name).json()["receipt"]["status"]
        for check, answer, name in zip(checks, wrong, ids, strict=True)
    ]
    assert statuses == ["active", "screened_out"]
    assert reasons(services) == [{"rule": "attention_checks_failed", "failed": 2}]
    again = participant.rate(checks[1], wrong[1], ids[1])  # the answer was lost, and is asked for again
    assert (again.status_code, again.json()["receipt"]["status"]) == (200, "screened_out")
    assert len(reasons(services)) == 1


@pytest.mark.parametrize(
    ("recruiter", "code", "address"),
    [
        (None, None, None),
        ({"kind": "prolific", "code_complete": "GOOD"}, None, None),
        (
            {"kind": "prolific", "code_screened_out": "OUT"},
            "OUT",
            "https://app.prolific.com/submissions/complete?cc=OUT",
        ),
        ({"kind": "sona", "redirect_url": "https://x.example/credit"}, None, None),
        (
            {"redirect_screened_out": "https://x.example/out?id={participant}"},
            None,
            "https://x.example/out?id=p%201",
        ),
    ],
)
def test_code_and_way_back_of_who_is_screened_out(
    screened: Screened, recruiter: dict[str, str] | None, code: str | None, address: str | None
) -> None:
    participant = screened(recruiter=recruiter)
    participant.client_id = str(uuid.uuid4())
    participant.start(query={"participant": "p 1"})
    participant.request("PUT", "/consent", {"agreed": True})
    participant.request("PUT", "/forms/about", {"answers": {"age": 90}})
    answers = [participant.request("POST", "/complete").json() for _ in range(2)]
    expected = {
        "status": "screened_out",
        "completion_code": code,
        "redirect_url": address,
        "reason": None,
    }
    assert answers == [expected, expected]


def test_a_device_is_screened_out_only_where_declared(
    client: TestClient, study: StudyInDatabase, screened: Screened, services: Services
) -> None:
    found = {"reason": "gate_screen", "data": {"screen_width_px": 320}}
    ordinary = Participant(client, study.link_token).agree()
    assert client.get(f"/api/links/{study.link_token}").json()["screens_devices"] is False
    assert error_code(ordinary.request("POST", "/screen-out", found)) == (409, "screening_undeclared")
    assert ordinary.state()["status"] == "active"
    strict = screened(DEVICE)
    assert client.get(f"/api/links/{strict.link}").json()["screens_devices"] is True
    assert strict.request("POST", "/screen-out", found).json()["status"] == "screened_out"
    assert reasons(services) == [{"rule": "device", "reason": "gate_screen", "screen_width_px": 320}]


def test_the_monitor_counts_who_was_screened_out(screened: Screened, services: Services) -> None:
    from server.models import Study
    from server.results.monitor import snapshot
    from server.studies.lookup import active_definition

    screened().request("PUT", "/forms/about", {"answers": {"age": 90}})
    screened()
    with services.database.read() as session:
        study = session.query(Study).filter_by(name="screened").one()
        shown = snapshot(session, study, active_definition(session, study))
    assert (shown.active, shown.complete, shown.screened_out) == (1, 0, 1)
    assert {step.stage: step.runs for step in shown.funnel}["calibration"] == 0
