from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.core.values import now
from server.models import AssignedTrial, RunEvent, StudyRun, TrialClip
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study


def error_code(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.json()["error"]["code"]


def age_runs(services: Services, **ages: timedelta) -> None:
    """Move moments of every run into the past."""
    with services.database.write() as session:
        for run in session.query(StudyRun):
            for column, age in ages.items():
                setattr(run, column, now() - age)


def test_an_open_link_shows_what_the_visitor_may_know(client: TestClient, study: StudyInDatabase) -> None:
    link = client.get(f"/api/links/{study.link_token}").json()
    assert (link["status"], link["kind"], link["resumable"]) == ("open", "general", False)
    assert link["study"]["title"] == "A short study"
    assert link["study"]["languages"] == ["en", "de"]
    assert link["gates"]["inter_ocular_mm"] == 60.0


def test_an_unknown_link(client: TestClient, study: StudyInDatabase) -> None:
    assert error_code(client.get("/api/links/nonsense")) == (404, "link_unknown")
    assert error_code(Participant(client, "nonsense").start()) == (404, "link_unknown")


def test_an_expired_link(client: TestClient, study: StudyInDatabase) -> None:
    link = study.link(expires_at=now() - timedelta(minutes=1))
    assert client.get(f"/api/links/{link}").json()["status"] == "expired"
    assert error_code(Participant(client, link).start()) == (409, "link_expired")


@pytest.mark.parametrize(
    ("change", "status", "code"),
    [
        ({"status": "closed"}, "closed", "study_closed"),
        ({"status": "draft"}, "closed", "study_closed"),
        ({"paused": True}, "paused", "study_paused"),
        ({"quota": 0}, "full", "study_full"),
    ],
)
def test_a_study_that_takes_nobody(
    client: TestClient, study: StudyInDatabase, change: dict[str, Any], status: str, code: str
) -> None:
    study.change(**change)
    assert client.get(f"/api/links/{study.link_token}").json()["status"] == status
    assert error_code(Participant(client, study.link_token).start()) == (409, code)


def test_starting_twice_gives_one_run(
    client: TestClient, participant: Participant, services: Services
) -> None:
    first, second = participant.start(), participant.start()
    assert (first.status_code, second.json()["run_token"]) == (201, first.json()["run_token"])
    participant.request("PUT", "/consent", {"agreed": True})
    third = participant.start()
    assert (third.status_code, third.json()["resumed"]) == (200, True)
    with services.database.read() as session:
        assert session.query(StudyRun).count() == 1


def test_a_personal_link_goes_on_from_another_device(client: TestClient, study: StudyInDatabase) -> None:
    link = study.link("personal", label="P07")
    first, second = Participant(client, link).agree(), Participant(client, link)
    trial = first.state()["trials"][0]
    first.rate(trial)
    assert client.get(f"/api/links/{link}").json() | {"study": 0, "gates": 0} == {
        "study": 0,
        "gates": 0,
        "status": "open",
        "kind": "personal",
        "resumable": True,
        "screens_devices": False,
        "way_back": None,
    }
    assert second.start().status_code == 200
    assert second.run_id == first.run_id
    assert second.state()["trials"][0]["answered"]


def test_a_personal_link_is_used_once_complete_but_shows_the_code_again(
    client: TestClient, study: StudyInDatabase
) -> None:
    link = study.link("personal", label="P08")
    participant = Participant(client, link).agree()
    participant.answer_all()
    code = participant.request("POST", "/complete").json()["completion_code"]
    assert client.get(f"/api/links/{link}").json()["status"] == "used"
    again = Participant(client, link)
    assert again.start().status_code == 200
    assert again.state()["completion_code"] == code


@pytest.mark.parametrize(
    ("policy", "outcome"), [("resume", 200), ("restart", 201), ("block", (409, "run_left"))]
)
def test_coming_back_follows_the_declared_policy(
    client: TestClient, services: Services, tmp_path: Path, policy: str, outcome: Any
) -> None:
    text = SHORT.replace("[session]", f'[session]\nresume = "{policy}"').replace('"short"', f'"{policy}"')
    study = add_study(services, tmp_path / "clips", text)
    participant = Participant(client, study.link_token).agree()
    first = participant.run_id
    answer = participant.start()
    assert (answer.status_code if answer.status_code < 300 else error_code(answer)) == outcome
    assert (participant.run_id != first) == (policy == "restart")


@pytest.mark.parametrize(
    ("policy", "until_h", "outcome"), [("resume", 72, 200), ("restart", None, 200), ("block", None, 409)]
)
def test_a_page_that_kept_its_token_follows_the_same_policy(
    client: TestClient, services: Services, tmp_path: Path, policy: str, until_h: int | None, outcome: int
) -> None:
    text = SHORT.replace("[session]", f'[session]\nresume = "{policy}"').replace('"short"', f'"{policy}"')
    study = add_study(services, tmp_path / "clips", text)
    participant = Participant(client, study.link_token)
    participant.start()
    before = participant.state()
    limit = datetime.fromisoformat(before["resumable_until"]) if until_h else None
    server_time = datetime.fromisoformat(before["server_time"])
    assert limit is None or abs(limit - server_time - timedelta(hours=72)) < timedelta(minutes=1)
    participant.request("PUT", "/consent", {"agreed": True})
    answer = participant.request("GET", "")
    assert answer.status_code == outcome
    assert policy != "block" or error_code(answer) == (409, "run_left")


def test_a_kept_token_does_not_take_up_a_run_that_is_too_old(
    participant: Participant, services: Services
) -> None:
    participant.agree()
    age_runs(services, started_at=timedelta(hours=73))
    assert error_code(participant.request("GET", "")) == (409, "run_too_old")


def test_a_run_that_is_too_old_is_not_taken_up(
    client: TestClient, participant: Participant, services: Services
) -> None:
    participant.agree()
    age_runs(services, started_at=timedelta(hours=73))
    assert error_code(participant.start()) == (409, "run_too_old")


def test_an_unknown_language_is_refused_by_name(participant: Participant) -> None:
    assert error_code(participant.start(language="fr")) == (422, "language_unknown")


def test_slots_are_dealt_evenly_and_a_drop_outs_slot_returns(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    people = [Participant(client, study.link_token).agree() for _ in range(4)]
    people[0].answer_all()
    people[0].request("POST", "/complete")
    people[2].request("POST", "/withdraw")
    with services.database.write() as session:
        silent = session.query(StudyRun).filter_by(public_id=people[1].run_id).one()
        assert [run.slot for run in session.query(StudyRun).order_by(StudyRun.id)] == [0, 1, 2, 3]
        silent.last_seen_at = now() - timedelta(minutes=61)
    for _ in range(3):
        Participant(client, study.link_token).agree()
    with services.database.read() as session:
        assert [run.slot for run in session.query(StudyRun).order_by(StudyRun.id)][4:] == [1, 2, 4]


def test_a_burst_of_starts_is_balanced_and_each_order_is_its_own(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    people = [Participant(client, study.link_token) for _ in range(24)]
    with ThreadPoolExecutor(8) as pool:
        assert {answer.status_code for answer in pool.map(lambda person: person.start(), people)} == {201}
    with services.database.read() as session:
        runs = session.query(StudyRun).order_by(StudyRun.id).all()
        assert sorted(run.slot for run in runs) == list(range(24))
        first_blocks = Counter(
            session.query(AssignedTrial.block_label).filter_by(study_run_id=run.id, block=1).first()[0]
            for run in runs
        )
        assert first_blocks == {"a": 12, "b": 12}
        orders = {
            tuple(clip.version_clip_id for clip in session.query(TrialClip).filter_by(study_run_id=run.id))
            for run in runs
        }
    assert len(orders) >= 20  # each drawn by itself: two of 24 meet in one burst of some hundred


def test_a_places_quota_counts_those_under_way(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    link = study.link(quota=1)
    assert Participant(client, link).start().status_code == 201
    assert error_code(Participant(client, link).start()) == (409, "study_full")
    age_runs(services, last_seen_at=timedelta(minutes=61))
    assert Participant(client, link).start().status_code == 201


def test_a_preview_works_on_a_draft_and_counts_for_nothing(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    study.change(status="draft", quota=0)
    preview = Participant(client, study.link("preview")).agree()
    preview.answer_all()
    assert preview.request("POST", "/complete").status_code == 200
    with services.database.read() as session:
        from sqlalchemy import text

        assert session.scalar(text("SELECT count(*) FROM ratings")) == 0
    age_runs(services, started_at=timedelta(hours=25))
    Participant(client, study.link("preview")).agree()
    with services.database.read() as session:
        assert session.query(StudyRun).count() == 1


def test_a_browser_turned_away_is_reported(
    client: TestClient, study: StudyInDatabase, services: Services
) -> None:
    report = {"link_token": study.link_token, "reason": "no_webcodecs", "data": {"width": 320}}
    assert client.post("/api/unsupported", json=report).status_code == 202
    with services.database.read() as session:
        event = session.query(RunEvent).one()
        assert (event.type, event.data["reason"]) == ("unsupported", "no_webcodecs")
    report["link_token"] = "nonsense"
    assert error_code(client.post("/api/unsupported", json=report)) == (404, "link_unknown")


def test_too_many_starts_must_wait(client: TestClient, study: StudyInDatabase) -> None:
    client.app.state.services.run_starts.per_minute = 2
    answers = [Participant(client, study.link_token).start() for _ in range(3)]
    assert [answer.status_code for answer in answers] == [201, 201, 429]
    assert int(answers[2].headers["retry-after"]) >= 1
