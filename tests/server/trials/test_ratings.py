import uuid
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import text

from server.context import Services
from server.models import Rating, StudyRun
from tests.helpers.studies import Participant, StudyInDatabase


def error_code(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def first_main(participant: Participant) -> Any:
    return next(trial for trial in participant.state()["trials"] if trial["kind"] == "main")


def test_a_rating_is_stored_with_its_receipt(participant: Participant, services: Services) -> None:
    trial = first_main(participant.agree())
    rating_id = str(uuid.uuid4())
    answer = participant.rate(
        trial, 6, rating_id, comment="quick", answered_at_client="2026-11-21T02:00:00+01:00"
    )
    receipt = answer.json()["receipt"]
    assert answer.status_code == 201
    assert (receipt["rating_id"], receipt["verdict"], receipt["rule"]) == (rating_id, "good", "")
    assert (receipt["again"], receipt["remaining"]) == (False, 11)
    with services.database.read() as session:
        row = session.execute(text("SELECT * FROM ratings")).mappings().one()
        assert (row["response"], row["rt"], row["comment"], row["method"]) == (6, 700.5, "quick", "webcodecs")
        assert row["saved_at"] == receipt["saved_at"].replace("+00:00", "Z")
        assert not row["focus_lost"]
        stored = session.query(Rating).one()
        assert stored.drawn == [[index, 10 + 33.3 * index] for index in range(4)]
        assert stored.answered_at_client.isoformat() == "2026-11-21T01:00:00+00:00"
        run = session.query(StudyRun).one()
        assert (run.trials_answered, run.elapsed_ms) == (1, 1000.0 * (trial["trial_index"] + 1))


def test_the_same_again_is_stored_once(participant: Participant, services: Services) -> None:
    trial = first_main(participant.agree())
    rating_id = str(uuid.uuid4())
    answers = [participant.rate(trial, 6, rating_id) for _ in range(3)]
    answers.append(participant.rate(trial, 6))  # another id for the same play and value
    assert [answer.status_code for answer in answers] == [201, 200, 200, 200]
    assert len({answer.json()["receipt"]["saved_at"] for answer in answers}) == 1
    with services.database.read() as session:
        assert session.query(Rating).count() == 1
        assert session.query(StudyRun).one().trials_answered == 1


def test_another_value_is_refused_and_the_first_kept(participant: Participant, services: Services) -> None:
    participant.agree()
    first, second = [trial for trial in participant.state()["trials"] if trial["kind"] == "main"][:2]
    rating_id = str(uuid.uuid4())
    participant.rate(first, 6, rating_id)
    assert error_code(participant.rate(first, 5, rating_id)) == (409, "rating_differs")
    assert error_code(participant.rate(first, 5)) == (409, "rating_differs")
    assert error_code(participant.rate(second, 6, rating_id)) == (409, "rating_differs")
    with services.database.read() as session:
        assert [rating.payload for rating in session.query(Rating)] == [{"response": 6}]


@pytest.mark.parametrize("response", [0, 8, -1, 2**40, 4.5])
def test_a_rating_off_the_scale(participant: Participant, response: float) -> None:
    answer = participant.rate(first_main(participant.agree()), response)
    assert error_code(answer) == (422, "rating_out_of_scale")
    assert "from 1 to 7" in answer.json()["error"]["message"]


@pytest.mark.parametrize("response", ["4", True, [4]])
def test_a_rating_that_is_not_a_number(participant: Participant, response: Any) -> None:
    assert error_code(participant.rate(first_main(participant.agree()), response)) == (422, "invalid")


def test_a_trial_that_is_not_in_the_run(participant: Participant) -> None:
    trial = first_main(participant.agree())
    assert error_code(participant.rate({**trial, "trial_index": 99})) == (404, "trial_not_in_run")


@pytest.mark.parametrize("field", ["rt", "time_elapsed"])
@pytest.mark.parametrize("value", [-1, 1e11])
def test_times_that_cannot_be_are_unknown_and_flag_the_play(
    participant: Participant, services: Services, field: str, value: float
) -> None:
    answer = participant.rate(first_main(participant.agree()), **{field: value})
    assert (answer.status_code, answer.json()["receipt"]["rule"]) == (201, "impossible_value")
    with services.database.read() as session:
        rating = session.query(Rating).one()
        assert (getattr(rating, field), rating.disturbances) == (None, {"impossible_value": 1})


def test_a_failed_clip_is_wanted_again_and_both_plays_are_kept(
    participant: Participant, services: Services
) -> None:
    trial = first_main(participant.agree())
    receipt = participant.rate(trial, 3, playback={"focus_lost": 2}).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"], receipt["again"]) == ("failed", "focus_lost", True)
    assert receipt["remaining"] == 12
    shown = participant.state()["trials"][trial["trial_index"]]
    assert (shown["plays_done"], shown["plays_wanted"], shown["answered"]) == (1, 2, False)
    receipt = participant.rate(trial, 5, play=2).json()["receipt"]
    assert (receipt["verdict"], receipt["again"], receipt["remaining"]) == ("good", False, 11)
    with services.database.read() as session:
        query = text("SELECT play, response, verdict FROM ratings ORDER BY play")
        assert [tuple(row) for row in session.execute(query)] == [(1, 3, "failed"), (2, 5, "good")]


def test_a_clip_that_fails_every_time_ends_its_trial(participant: Participant) -> None:
    trial = first_main(participant.agree())
    lost = {"method": "none", "clip_sha256": None, "drawn": [], "frames_missing": None}
    first = participant.rate(trial, None, playback=lost).json()["receipt"]
    last = participant.rate(trial, None, play=2, playback=lost).json()["receipt"]
    assert (first["again"], last["again"], last["remaining"]) == (True, False, 11)
    assert error_code(participant.rate(trial, 4, play=3)) == (422, "play_out_of_range")


def test_plays_may_arrive_in_the_wrong_order(participant: Participant, services: Services) -> None:
    trial = first_main(participant.agree())
    assert participant.rate(trial, 5, play=2).json()["receipt"]["remaining"] == 11
    late = participant.rate(trial, 3, play=1, playback={"focus_lost": 1}).json()["receipt"]
    assert (late["again"], late["remaining"]) == (False, 11)
    with services.database.read() as session:
        assert session.query(Rating).count() == 2


def test_an_attention_check_needs_an_answer(participant: Participant, services: Services) -> None:
    participant.agree()
    check = next(trial for trial in participant.state()["trials"] if trial["kind"] == "attention")
    assert error_code(participant.rate(check, None)) == (422, "rating_missing")
    assert participant.rate(check, 2).json()["receipt"]["verdict"] == "good"
    with services.database.read() as session:
        row = session.execute(text("SELECT kind, expected_response, cell FROM ratings")).one()
        asked = int(check["prompt"].split("**")[1])
        assert tuple(row) == ("attention", asked, None)


def test_ratings_carry_the_calibration_they_were_made_with(
    participant: Participant, services: Services
) -> None:
    from tests.server.participants.test_runs import CALIBRATION

    first, second = participant.agree().state()["trials"][:2]
    participant.request("PUT", "/calibration", CALIBRATION)
    participant.rate(first)
    participant.request("PUT", "/calibration", {**CALIBRATION, "px_per_mm": 5.0, "viewing_distance_mm": 610})
    participant.rate(second)
    with services.database.read() as session:
        query = text("SELECT px_per_mm, viewing_distance_mm FROM ratings ORDER BY trial_index")
        assert [tuple(row) for row in session.execute(query)] == [(3.8, None), (5.0, 610.0)]


def test_many_at_once_are_each_stored_once(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    people = [Participant(client, study.link_token).agree() for _ in range(4)]
    work = [(person, trial, str(uuid.uuid4())) for person in people for trial in person.state()["trials"]]
    with ThreadPoolExecutor(16) as pool:
        answers = list(pool.map(lambda item: item[0].rate(item[1], 4, item[2]), work * 2))
    assert sorted(answer.status_code for answer in answers) == [200] * 48 + [201] * 48
    with services.database.read() as session:
        assert session.query(Rating).count() == 48
        assert {run.trials_answered for run in session.query(StudyRun)} == {12}


@settings(deadline=None, max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 11), st.integers(1, 7)), max_size=10))
def test_whatever_is_sent_a_trial_has_one_first_play(
    client: TestClient, study: StudyInDatabase, services: Services, sent: list[tuple[int, int]]
) -> None:
    participant = Participant(client, study.link_token).agree()
    trials = participant.state()["trials"]
    first: dict[int, int] = {}
    for index, response in sent:
        answer = participant.rate(trials[index], response)
        kept = first.setdefault(index, response)
        assert answer.status_code in ((201, 200) if kept == response else (409,))
    with services.database.read() as session:
        query = text("SELECT trial_index, response FROM ratings WHERE run = :run")
        assert dict(map(tuple, session.execute(query, {"run": participant.run_id}))) == first
