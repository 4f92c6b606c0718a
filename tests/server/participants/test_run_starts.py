"""Many visits begun at once share transactions; what one of them is refused touches no other."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.context import Services
from server.models import AssignedTrial, Study, StudyRun
from server.participation.run_repository import lock_study
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study
from tests.helpers.waiting import until

AT_ONCE = 24


def start_all(people: list[Participant]) -> list[int]:
    with ThreadPoolExecutor(len(people)) as pool:
        return [answer.status_code for answer in pool.map(lambda person: person.start(), people)]


def test_all_who_start_at_once_get_an_order_of_their_own(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    people = [Participant(client, study.link_token) for _ in range(AT_ONCE)]
    assert start_all(people) == [201] * AT_ONCE
    with services.database.read() as session:
        runs = session.query(StudyRun).order_by(StudyRun.slot).all()
        assert [run.slot for run in runs] == list(range(AT_ONCE))
        per_run = Counter(run for (run,) in session.query(AssignedTrial.study_run_id))
        firsts = session.execute(
            text(
                "SELECT block_label, count(*) FROM assigned_trials "
                "WHERE kind = 'main' AND block = 1 GROUP BY block_label"
            )
        ).all()
    assert per_run == {run.id: run.trials_total for run in runs}
    assert len({run.seed for run in runs}) == AT_ONCE
    assert len({count for _, count in firsts}) == 1


def test_a_quota_holds_when_all_start_at_once(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    study.change(quota=5)
    answers = start_all([Participant(client, study.link_token) for _ in range(AT_ONCE)])
    assert Counter(answers) == {201: 5, 409: AT_ONCE - 5}
    with services.database.read() as session:
        assert session.query(StudyRun).count() == 5


def test_who_cannot_start_over_keeps_the_visit_there_was(
    client: TestClient, services: Services, quick_folder: Path
) -> None:
    text_of_study = SHORT.replace("[session]", '[session]\nresume = "restart"')
    study = add_study(services, quick_folder / "clips", text_of_study)
    person = Participant(client, study.link_token).agree()
    study.change(paused=True)
    assert person.start().json()["error"]["code"] == "study_paused"
    assert person.state()["status"] == "active"
    study.change(paused=False)
    assert person.start().status_code == 201
    with services.database.read() as session:
        assert Counter(run.status for run in session.query(StudyRun)) == {"withdrawn": 1, "active": 1}


@pytest.mark.parametrize("left", [(), (0,), (2, 3), (5,), (0, 1, 2, 3, 4, 5)])
def test_the_next_run_gets_the_smallest_slot_that_nobody_holds(
    client: TestClient, study: StudyInDatabase, services: Services, left: tuple[int, ...]
) -> None:
    people = [Participant(client, study.link_token).agree() for _ in range(6)]
    for slot in left:
        assert people[slot].request("POST", "/withdraw").status_code == 200
    late = Participant(client, study.link_token).agree()
    with services.database.read() as session:
        run = session.query(StudyRun).filter_by(public_id=late.run_id).one()
        assert run.slot == min(left, default=6)


@pytest.mark.parametrize(
    "database_url", [pytest.param("postgres", marks=pytest.mark.postgres)], indirect=True
)
def test_a_completion_waits_for_a_start_without_holding_its_run(
    services: Services, participant: Participant
) -> None:
    """A start holds the study, then may touch a run; a completion that held the run first would deadlock."""
    participant.agree().answer_all()
    with ThreadPoolExecutor(1) as pool, services.database.write() as session:
        study = session.query(Study).one()
        lock_study(session, study.id)
        completion = pool.submit(participant.request, "POST", "/complete")
        waits = "SELECT count(*) FROM pg_locks WHERE NOT granted"
        until(lambda: completion.done() or session.scalar(text(waits)))
        assert not completion.done()
        session.execute(text("SELECT 1 FROM study_runs FOR UPDATE NOWAIT"))
        session.commit()
        assert completion.result(30).json()["status"] == "complete"
