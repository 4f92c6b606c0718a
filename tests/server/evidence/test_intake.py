"""What comes with an answer is checked: its ticket, the time there was, and its clip."""

import uuid
from datetime import timedelta
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from server.context import Services
from server.core.values import now
from server.models import AnswerEvidence, RunEvent, StudyRun
from server.participation.evidence_repository import has_refusals
from server.participation.intake import FALSE_ANSWERS_PER_MINUTE
from server.participation.judgement import judge_run
from tests.helpers.admins import signed_in
from tests.helpers.evidence import Watcher
from tests.helpers.studies import StudyInDatabase
from tests.server.evidence.conftest import CLIP_S

SHOWN_S = CLIP_S + 1.0


def with_clips(state: Any) -> list[Any]:
    return [trial for trial in state["trials"] if trial["clip_sha256"]]


def code(response: Any) -> str:
    return f"{response.status_code} {response.json()['error']['code']}"


def rows(services: Services) -> list[AnswerEvidence]:
    with services.database.read() as session:
        return list(session.scalars(select(AnswerEvidence).order_by(AnswerEvidence.received_at)))


def test_honest_answers_are_taken_with_their_evidence(watcher: Watcher, services: Services) -> None:
    for trial in watcher.state()["trials"]:
        watcher.wait(SHOWN_S)
        assert watcher.answer(trial).status_code == 201
    kept = rows(services)
    assert len(kept) == 12
    assert all(row.ticket and not row.late for row in kept)
    assert [row.digest_right for row in kept].count(True) == 10
    assert kept[0].interaction == {"presses": 2, "trusted": 2, "press_ms": 90.0, "moves": 5}


def test_the_plain_http_program_is_refused(client: TestClient, study: StudyInDatabase) -> None:
    bot = Watcher(client, study.link_token)
    bot.moment = now()
    bot.start()
    bot.request("PUT", "/consent", {"agreed": True})
    trials = bot.state()["trials"]
    assert {code(bot.rate(trial)) for trial in trials} == {"422 ticket_missing"}


def until_limited(bot: Watcher, trial: Any) -> int:
    """How many false answers are heard; on a slow machine the share refills meanwhile."""
    for sent in range(20 * FALSE_ANSWERS_PER_MINUTE):
        said = code(bot.rate(trial))
        if said == "429 too_many_requests":
            return sent
        assert said == "422 ticket_missing"
    raise AssertionError("false answers were never limited")


def test_ten_thousand_false_answers_are_noted_once_and_hinder_nobody(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    bot, honest = Watcher(client, study.link_token), Watcher(client, study.link_token).begin()
    bot.moment = now()
    bot.start()
    bot.request("PUT", "/consent", {"agreed": True})
    trial = bot.state()["trials"][0]
    assert until_limited(bot, trial) >= FALSE_ANSWERS_PER_MINUTE
    first = honest.state()["trials"][0]
    honest.wait(SHOWN_S)
    assert honest.answer(first).status_code == 201
    with services.database.read() as session:
        noted = session.execute(select(RunEvent).where(RunEvent.type == "answer_refused")).scalars().all()
        assert [event.data for event in noted] == [{"code": "ticket_missing"}]
        run = session.scalars(select(StudyRun).where(StudyRun.public_id == bot.run_id)).one()
        assert judge_run(session, run).verdict == "unlikely"
    found = signed_in(client, services, "owner").get(f"/studies/short/runs/{bot.run_id}/evidence").json()
    assert found["verdict"] == "unlikely"
    assert found["reasons"][0] == "Answers were refused, because their evidence was wrong."
    assert "do not show that a person answered" in found["reasons"][-1]


def test_clips_cannot_outlast_the_time_since_their_tickets(watcher: Watcher) -> None:
    trials = with_clips(watcher.state())
    watcher.wait(SHOWN_S)
    answers = [watcher.answer(trial) for trial in trials]
    assert answers[0].status_code == 201
    assert {code(one) for one in answers[1:]} == {"409 clips_outlast_tickets"}


def test_many_batches_do_not_multiply_the_time(watcher: Watcher) -> None:
    """As many batches as trials, all taken at once: each alone would have time enough."""
    trials = with_clips(watcher.state())
    batches = [watcher.state()["tickets"] for _ in trials]
    watcher.wait(SHOWN_S)
    taken = 0
    for batch, trial in zip(batches, trials, strict=True):
        watcher.tickets = batch
        taken += watcher.answer(trial).status_code == 201
    assert taken == 1


def test_an_hour_offline_is_late_and_nothing_else(watcher: Watcher, services: Services) -> None:
    trials = with_clips(watcher.state())
    given = []
    for trial in trials:
        watcher.wait(SHOWN_S)
        given.append((trial, watcher.moment))
    watcher.wait(3600)
    for trial, moment in given:
        answer = watcher.rate(trial, evidence=watcher.evidence(trial), answered_at_client=moment.isoformat())
        assert answer.status_code == 201
    assert all(row.late for row in rows(services))


@pytest.mark.parametrize("years", [-30, 30])
def test_a_client_s_clock_years_off_is_not_a_reason_to_refuse(watcher: Watcher, years: int) -> None:
    trial = with_clips(watcher.state())[0]
    watcher.wait(SHOWN_S)
    moment = watcher.moment + timedelta(days=365 * years)
    answer = watcher.rate(trial, evidence=watcher.evidence(trial), answered_at_client=moment.isoformat())
    assert answer.status_code == 201


def test_the_server_s_clock_set_back_is_not_a_reason_to_refuse(watcher: Watcher) -> None:
    trial = with_clips(watcher.state())[0]
    watcher.wait(-7200)
    assert watcher.answer(trial).status_code == 201


def test_a_reload_gets_new_tickets_and_the_old_ones_stay_good(watcher: Watcher) -> None:
    first, second = with_clips(watcher.state())[:2]
    older = watcher.evidence(first)
    watcher.wait(2 * SHOWN_S)
    watcher.state()
    watcher.wait(SHOWN_S)
    assert watcher.answer(second).status_code == 201
    assert watcher.answer(first, older).status_code == 201


def test_a_digest_of_another_clip_or_none_is_refused(watcher: Watcher) -> None:
    first, second = with_clips(watcher.state())[:2]
    watcher.wait(3 * SHOWN_S)
    other = watcher.evidence(first, digest=watcher.evidence(second)["digest"])
    assert code(watcher.answer(first, other)) == "422 clip_digest_differs"
    assert code(watcher.answer(first, watcher.evidence(first, digest=None))) == "422 clip_digest_missing"
    assert watcher.answer(first).status_code == 201


def test_tickets_of_another_run_and_tampered_ones_are_refused(
    watcher: Watcher, client: TestClient, study: StudyInDatabase
) -> None:
    trial = with_clips(watcher.state())[0]
    watcher.wait(SHOWN_S)
    other = Watcher(client, study.link_token).begin()
    stolen = other.evidence(trial)
    assert code(watcher.answer(trial, stolen)) == "422 ticket_of_another_run"
    for changes, refusal in (
        ({"batch": "x.1.2.3"}, "422 ticket_invalid"),
        ({"ticket": "A" * 22}, "422 ticket_of_another_trial"),
        ({"batch": "é"}, "422 invalid"),
    ):
        assert code(watcher.answer(trial, watcher.evidence(trial) | changes)).startswith(refusal[:5])
    assert watcher.answer(trial).status_code == 201


def test_false_answers_are_limited_without_touching_others(
    watcher: Watcher, client: TestClient, study: StudyInDatabase
) -> None:
    trial = with_clips(watcher.state())[0]
    assert until_limited(watcher, trial) >= FALSE_ANSWERS_PER_MINUTE
    other = Watcher(client, study.link_token).begin()
    trials = with_clips(other.state())
    other.wait(SHOWN_S)
    assert other.answer(trials[0]).status_code == 201


def begun(watcher: Watcher, trial: Any) -> dict[str, Any]:
    """A view that begins, with its ticket."""
    given = watcher.evidence(trial)
    return {
        "id": str(uuid.uuid4()),
        "trial_index": trial["trial_index"],
        "number": 1,
        "started_at_client": watcher.moment.isoformat(),
        "evidence": {"batch": given["batch"], "ticket": given["ticket"]},
    }


def test_an_answer_after_a_reload_needs_no_second_view(watcher: Watcher) -> None:
    """The clip was seen by the tickets of the page before; those of the reloaded page are seconds old."""
    first, second = with_clips(watcher.state())[:2]
    assert watcher.request("POST", "/views", {"views": [begun(watcher, first)]}).status_code == 200
    watcher.wait(SHOWN_S)
    watcher.state()
    watcher.wait(0.1)
    assert watcher.answer(first).status_code == 201
    assert code(watcher.answer(second)) == "409 clips_outlast_tickets"


def test_views_reported_at_once_leave_no_time_to_watch_them(watcher: Watcher) -> None:
    trials = with_clips(watcher.state())
    views = [begun(watcher, trial) for trial in trials]
    assert watcher.request("POST", "/views", {"views": views}).status_code == 200
    watcher.wait(SHOWN_S)
    watcher.state()
    watcher.wait(0.1)
    assert [watcher.answer(trial).status_code for trial in trials].count(201) == 1


def test_an_expired_ticket_is_refused_and_costs_the_run_nothing(watcher: Watcher, services: Services) -> None:
    """A page that stood open for months: its answer is not taken, and nobody is doubted for it."""
    first, *others = watcher.state()["trials"]
    old = watcher.evidence(first)
    watcher.wait(61 * 86_400)
    assert [code(watcher.answer(first, old)) for _ in range(3)] == ["409 ticket_expired"] * 3
    watcher.state()
    for trial in others:
        watcher.wait(SHOWN_S)
        assert watcher.answer(trial).status_code == 201
    with services.database.read() as session:
        kinds = select(RunEvent.type).where(RunEvent.type.startswith("answer_"))
        assert session.scalars(kinds).all() == ["answer_expired"]
        [run] = session.scalars(select(StudyRun))
        assert not has_refusals(session, run)


def test_more_trusted_presses_than_presses_are_refused(watcher: Watcher, services: Services) -> None:
    """A share above one would pass for a person's."""
    trial = with_clips(watcher.state())[0]
    watcher.wait(SHOWN_S)
    claimed = {"presses": 2, "trusted": 3, "press_ms": 90.0, "moves": 5}
    answer = watcher.answer(trial, watcher.evidence(trial, interaction=claimed))
    assert code(answer) == "422 invalid"
    assert "at most as many trusted presses as presses, got 3 of 2" in answer.text
    assert rows(services) == []
    assert watcher.answer(trial).status_code == 201


def test_a_replayed_ticket_brings_no_second_answer(watcher: Watcher, services: Services) -> None:
    trial = with_clips(watcher.state())[0]
    watcher.wait(10 * SHOWN_S)
    given = watcher.evidence(trial)
    assert watcher.answer(trial, given).status_code == 201
    assert code(watcher.answer(trial, given, response=2)) == "409 rating_differs"
    again = watcher.answer(trial, given | {"digest": None}, play=2)
    assert code(again) == "422 ticket_of_another_trial"
    assert len(rows(services)) == 1


def test_an_outbox_that_was_away_for_months_is_a_late_delivery(watcher: Watcher, services: Services) -> None:
    """Given in time, delivered after the ticket's time: taken, marked late, nothing noted against it."""
    given = []
    for trial in watcher.state()["trials"]:
        watcher.wait(SHOWN_S)
        given.append((trial, watcher.moment))
    watcher.wait(90 * 86_400)
    for trial, moment in given:
        answer = watcher.rate(trial, evidence=watcher.evidence(trial), answered_at_client=moment.isoformat())
        assert answer.status_code == 201
    assert [row.late for row in rows(services)] == [True] * len(given)
    with services.database.read() as session:
        [run] = session.scalars(select(StudyRun))
        assert not has_refusals(session, run)
        assert judge_run(session, run).signals.late == 1


def test_each_refusal_has_the_one_error_shape_and_is_noted_once(watcher: Watcher, services: Services) -> None:
    trial = with_clips(watcher.state())[0]
    watcher.wait(SHOWN_S)
    good = watcher.evidence(trial)
    for changes in ({"batch": "x.1.2.3"}, {"ticket": "A" * 22}, {"digest": None}, {"digest": "0" * 64}):
        for _ in range(3):
            answer = watcher.answer(trial, good | changes)
            assert 400 <= answer.status_code < 500
            assert set(answer.json()) == {"error"}
            assert set(answer.json()["error"]) == {"code", "message", "details"}
    with services.database.read() as session:
        noted = [event.data["code"] for event in session.scalars(select(RunEvent).order_by(RunEvent.id))]
    assert sorted(code for code in noted if code) == sorted(
        ("ticket_invalid", "ticket_of_another_trial", "clip_digest_missing", "clip_digest_differs")
    )
    assert watcher.answer(trial, good).status_code == 201
