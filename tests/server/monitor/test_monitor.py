import pytest
from fastapi.testclient import TestClient
from sqlalchemy import delete

from server.context import Services
from server.models import StudyRun
from server.results import endpoints
from server.results.schemas import MonitorSnapshot
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def test_the_monitor_counts_and_colours_trials(viewer: Admin, participant: Participant) -> None:
    participant.agree()
    trials = participant.state()["trials"]
    participant.rate(trials[0])
    participant.rate(trials[1], playback={"frames_drawn": 3, "frames_missing": 1})
    shown = viewer.get("/studies/short/monitor").json()
    [run] = shown["runs"]
    assert run["heat"] == "gf" + "." * 10
    assert (run["answered"], run["flagged"], run["presence"]) == (2, 1, "here")
    # Both were practice: the study counts 8 of the 12, without 2 of practice and 2 attention questions.
    assert (run["main_answered"], run["main_trials"]) == (0, 8)
    assert [step["runs"] for step in shown["funnel"]][:2] == [1, 1]
    assert (shown["active"], shown["complete"], shown["dropped"]) == (1, 0, 0)


def test_a_complete_run_has_as_many_main_trials_as_the_study_counts(
    viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    for trial in participant.state()["trials"]:
        participant.rate(trial)
    [run] = viewer.get("/studies/short/monitor").json()["runs"]
    assert (run["answered"], run["trials"]) == (12, 12)
    assert (run["main_answered"], run["main_trials"]) == (8, 8)


def test_only_changed_runs_are_sent_again(viewer: Admin, client, study: StudyInDatabase) -> None:  # type: ignore[no-untyped-def]
    people = [Participant(client, study.link_token).agree() for _ in range(2)]
    before = MonitorSnapshot.model_validate(viewer.get("/studies/short/monitor").json())
    people[1].rate(people[1].state()["trials"][0])
    after = MonitorSnapshot.model_validate(viewer.get("/studies/short/monitor").json())
    sent = MonitorSnapshot.model_validate_json(endpoints.snapshot_changes(before, after))
    assert people[1].run_id in {run.run for run in sent.runs}
    assert len(after.runs) == 2


def test_previews_are_not_monitored(viewer: Admin, client, study: StudyInDatabase) -> None:  # type: ignore[no-untyped-def]
    Participant(client, study.link("preview")).start()
    assert viewer.get("/studies/short/monitor").json()["runs"] == []


def test_an_erased_run_shows_no_answers(experimenter: Admin, participant: Participant) -> None:
    participant.agree().rate(participant.state()["trials"][0])
    assert experimenter.get("/studies/short/monitor").json()["runs"][0]["answered"] == 1
    erased = experimenter.send(
        "POST", f"/studies/short/runs/{participant.run_id}/erase", {"confirm": participant.run_id}
    )
    assert erased.status_code < 300, erased.text
    [run] = experimenter.get("/studies/short/monitor").json()["runs"]
    assert (run["answered"], run["heat"]) == (0, "." * 12)


def test_who_takes_the_place_of_a_deleted_preview_gets_a_row_of_her_own(
    viewer: Admin,
    client: TestClient,
    services: Services,
    study: StudyInDatabase,
) -> None:
    """SQLite gives the numbers of deleted runs and ratings to the next ones."""
    preview = Participant(client, study.link("preview")).agree()
    for trial in preview.state()["trials"][:3]:
        preview.rate(trial)
    viewer.get("/studies/short/monitor")
    with services.database.write() as session:
        session.execute(delete(StudyRun))
    person = Participant(client, study.link_token).agree()
    trials = person.state()["trials"]
    person.rate(trials[1])
    [run] = viewer.get("/studies/short/monitor").json()["runs"]
    assert run["heat"] == ".g" + "." * 10


def test_every_run_is_counted_and_the_latest_are_listed(
    viewer: Admin, client: TestClient, study: StudyInDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server.results.monitor.MAX_LISTED", 2)
    people = [Participant(client, study.link_token).agree() for _ in range(3)]
    people[0].answer_all()
    assert people[0].request("POST", "/complete").status_code == 200
    study.change(quota=5)
    shown = viewer.get("/studies/short/monitor").json()
    assert [run["run"] for run in shown["runs"]] == [one.run_id for one in people[1:]]
    assert (shown["total"], shown["complete"], shown["active"]) == (3, 1, 2)
    reached = {step["stage"]: step["runs"] for step in shown["funnel"]}
    assert (reached["consent"], reached["done"]) == (3, 1)
    assert "forms_before" in reached
    assert "forms_after" not in reached  # the study has no questionnaire after the trials


def test_a_finished_run_is_done_in_the_table_as_in_the_funnel(
    viewer: Admin, participant: Participant
) -> None:
    participant.agree()
    participant.request("PUT", "/stage", {"stage": "debrief"})
    participant.answer_all()
    assert participant.request("POST", "/complete").status_code == 200
    shown = viewer.get("/studies/short/monitor").json()
    [run] = shown["runs"]
    assert (run["presence"], run["stage"], shown["funnel"][-1]) == (
        "finished",
        "done",
        {"stage": "done", "runs": 1},
    )


def test_the_monitor_is_of_one_origin_and_shows_how_many_others_there_are(
    viewer: Admin, study: StudyInDatabase, client: TestClient
) -> None:
    Participant(client, study.link_token).agree()
    for link in (study.link(synthetic=True), study.link(synthetic=True), study.link("preview")):
        Participant(client, link).agree()
    shown = viewer.get("/studies/short/monitor").json()
    assert (shown["origin"], shown["total"], len(shown["runs"])) == ("participant", 1, 1)
    assert shown["others"] == {"simulated": 2}
    simulated = viewer.get("/studies/short/monitor?origin=simulated").json()
    assert (simulated["total"], simulated["active"], simulated["others"]) == (2, 2, {"participant": 1})
    assert {run["origin"] for run in simulated["runs"]} == {"simulated"}
    preview = viewer.get("/studies/short/monitor?origin=preview").json()
    assert (preview["total"], preview["others"]) == (1, {"participant": 1, "simulated": 2})
    assert viewer.get("/studies/short/monitor?origin=nobody").status_code == 422
