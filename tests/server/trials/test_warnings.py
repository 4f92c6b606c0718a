"""Who answers without care is warned kindly, and a run that goes on so ends with its own code."""

import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.rules import WarnFast, WarnPattern, WarnSameAnswer
from experiments.rules.warnings import GivenAnswer
from server.context import Services
from server.models import RunEvent
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study

RULES = """
[[warnings.rules]]
rule = "same_answer"
answers = 5

[[warnings.rules]]
rule = "fast_answers"
answers = 6
below_ms = 200
"""
MANY = SHORT.replace("per_cell = 2", "per_cell = 9").replace('name = "short"', 'name = "warned"')
CODES = {
    "kind": "generic",
    "code_complete": "DONE",
    "code_failed_check": "FAILED",
    "code_screened_out": "OUT",
}
Warned = Callable[..., Participant]


@pytest.fixture
def warned(client: TestClient, services: Services, quick_folder: Path) -> Warned:
    """Makes a participant, after consent, of a study of 36 clips with these warnings."""

    def make(rules: str = "[warnings]\n" + RULES, recruiter: dict[str, Any] | None = None) -> Participant:
        text = MANY.replace("[texts.en]", rules + "\n[texts.en]", 1)
        study: StudyInDatabase = add_study(services, quick_folder / "clips", text)
        study.change(recruiter=CODES if recruiter is None else recruiter)
        return Participant(client, study.link_token).agree()

    return make


def main_trials(participant: Participant) -> list[Any]:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"]


def rate(participant: Participant, trials: list[Any], response: int = 4, rt: float = 700.0) -> list[Any]:
    """The receipts of answers that are all the same."""
    saved = [participant.rate(trial, response, rt=rt) for trial in trials]
    return [one.json()["receipt"] for one in saved if one.status_code == 201]


def show(participant: Participant) -> None:
    event = {"id": str(uuid.uuid4()), "type": "warning_shown"}
    assert participant.request("POST", "/events", {"events": [event]}).status_code == 200


def test_the_fifth_equal_answer_is_warned_of_in_the_participant_s_words(warned: Warned) -> None:
    participant = warned()
    participant.request("PUT", "/language", {"language": "de"})
    receipts = rate(participant, main_trials(participant)[:5])
    assert [one.get("warning") for one in receipts[:4]] == [None] * 4
    warning = receipts[4].get("warning")
    assert (warning["rule"], warning["number"], warning["maximum"]) == ("same_answer", 1, 2)
    assert "Ihre letzten Antworten waren alle gleich" in warning["text"]
    assert participant.state()["warning"] == warning
    show(participant)
    assert participant.state()["warning"] is None


def test_who_goes_on_is_ended_with_the_code_of_a_failed_check(warned: Warned, services: Services) -> None:
    participant = warned()
    trials = main_trials(participant)
    for part in (trials[:5], trials[5:10]):
        assert rate(participant, part)[-1].get("warning")
        show(participant)
    assert [one["status"] for one in rate(participant, trials[10:15])] == ["active"] * 4 + ["screened_out"]
    assert participant.rate(trials[15], 4).json()["error"]["code"] == "run_closed"
    done = participant.request("POST", "/complete").json()
    assert (done["status"], done["completion_code"]) == ("screened_out", "FAILED")
    assert done["reason"].startswith("Your answers went on as")
    with services.database.read() as session:
        ended = session.query(RunEvent).filter_by(type="screened_out").one()
        assert ended.data == {"rule": "warnings", "lapse": "same_answer"}


@pytest.mark.parametrize(
    ("code", "recruiter", "given"),
    [
        ("screened_out", CODES, "OUT"),
        ("failed_check", CODES | {"code_failed_check": ""}, "OUT"),
        ("failed_check", {"kind": "generic", "code_complete": "DONE"}, None),
    ],
)
def test_the_code_is_the_declared_one_and_never_that_of_a_complete_run(
    warned: Warned, code: str, recruiter: dict[str, Any], given: str | None
) -> None:
    participant = warned(f'[warnings]\nmaximum = 1\ncode = "{code}"\n' + RULES, recruiter)
    trials = main_trials(participant)
    rate(participant, trials[:5])
    show(participant)
    assert rate(participant, trials[5:10])[-1]["status"] == "screened_out"
    assert participant.request("POST", "/complete").json()["completion_code"] == given


def test_nobody_is_ended_by_answers_from_before_a_warning_was_read(warned: Warned) -> None:
    """An outbox that delivers everything at once leads to one warning, however many answers it holds."""
    participant = warned()
    receipts = rate(participant, main_trials(participant)[:30])
    assert sum(one.get("warning") is not None for one in receipts) == 1
    assert receipts[-1]["status"] == "active"


def test_who_improves_hears_no_more(warned: Warned) -> None:
    participant = warned()
    trials = main_trials(participant)
    rate(participant, trials[:5])
    show(participant)
    for place, trial in enumerate(trials[5:]):
        receipt = rate(participant, [trial], response=1 + place * 3 % 7)[0]
        assert receipt.get("warning") is None
        assert receipt["status"] == "active"


def test_the_same_answer_sent_again_brings_its_warning_again(warned: Warned) -> None:
    participant = warned()
    trials = main_trials(participant)
    rate(participant, trials[:4])
    ident = str(uuid.uuid4())
    first = participant.rate(trials[4], 4, rating_id=ident)
    again = participant.rate(trials[4], 4, rating_id=ident)
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()


def test_warnings_alone_end_nothing(warned: Warned) -> None:
    participant = warned('[warnings]\nmaximum = 1\nthen = "go_on"\n' + RULES)
    trials = main_trials(participant)
    rate(participant, trials[:5])
    show(participant)
    receipts = rate(participant, trials[5:])
    assert {(one.get("warning"), one["status"]) for one in receipts} == {(None, "active")}


def test_practice_and_checks_are_warned_of_by_nothing(warned: Warned) -> None:
    participant = warned('[warnings]\n[[warnings.rules]]\nrule = "fast_answers"\nanswers = 5\n')
    others = [trial for trial in participant.state()["trials"] if trial["kind"] == "practice"]
    main = main_trials(participant)
    receipts = rate(participant, [*others, *main[:4]], rt=20.0)
    assert all(one.get("warning") is None for one in receipts)
    assert rate(participant, main[4:5], rt=20.0)[0].get("warning")["rule"] == "fast_answers"


def given(values: list[Any], rt: float | None = 700.0) -> list[GivenAnswer]:
    return [GivenAnswer(str(value), rt) for value in values]


@pytest.mark.parametrize(
    ("rule", "answers", "lapses"),
    [
        (WarnSameAnswer(), given([3] * 20), True),
        (WarnSameAnswer(), given([3] * 19 + [4]), False),
        (WarnPattern(), given([1, 2] * 10), True),
        (WarnPattern(), given([1, 2, 3, 4] * 5), True),
        (WarnPattern(), given([1, 2, 3, 4, 5] * 4), False),
        (WarnPattern(), given([1, 2] * 9 + [1, 1]), False),
        (WarnPattern(), given([3] * 20), False),
        (WarnFast(), given(list(range(10)), 249.0), True),
        (WarnFast(), given(list(range(10)), 251.0), False),
        (WarnFast(), given(list(range(10)), None), False),
    ],
)
def test_each_rule_sees_its_own_lapse(rule: Any, answers: list[GivenAnswer], lapses: bool) -> None:
    assert rule.lapses(answers) is lapses
