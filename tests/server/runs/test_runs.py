from server.context import Services
from server.models import FormAnswer, Rating, StudyRun
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase


def test_a_timeline_shows_every_play(viewer: Admin, participant: Participant) -> None:
    participant.agree().rate_all()
    timeline = viewer.get(f"/studies/short/runs/{participant.run_id}").json()
    assert len(timeline["trials"]) == 12
    assert timeline["trials"][0]["drawn"][1] == [1, 43.3]
    summary = timeline["summary"]
    assert summary["answered"] == 12
    # Practice and attention questions are left out of what the participants page counts.
    main = sum(trial["kind"] == "main" for trial in timeline["trials"])
    assert 0 < main < 12
    assert (summary["main_answered"], summary["main_trials"]) == (main, main)
    [listed] = viewer.get("/studies/short/runs").json()["runs"]
    assert (listed["main_answered"], listed["main_trials"]) == (main, main)


def test_exclusion_is_kept_with_its_reason_and_can_be_undone(
    experimenter: Admin, participant: Participant
) -> None:
    participant.agree().rate_all()
    path = f"/studies/short/runs/{participant.run_id}/exclusion"
    assert experimenter.send("PUT", path, {"reason": "fell asleep"}).status_code == 204
    [run] = experimenter.get("/studies/short/runs").json()["runs"]
    assert (run["excluded"], run["exclusion_reason"]) == (True, "fell asleep")
    assert "fell asleep" in experimenter.get("/studies/short/data/ratings.csv").text
    assert experimenter.send("DELETE", path).status_code == 204
    [run] = experimenter.get("/studies/short/runs").json()["runs"]
    assert (run["excluded"], run["exclusion_reason"]) == (False, None)


def test_a_reason_must_be_given(experimenter: Admin, participant: Participant) -> None:
    participant.agree()
    answer = experimenter.send("PUT", f"/studies/short/runs/{participant.run_id}/exclusion", {"reason": " "})
    assert answer.status_code == 422


def test_erasure_leaves_a_tombstone_and_nothing_else(
    services: Services, experimenter: Admin, participant: Participant
) -> None:
    participant.agree()
    participant.request("PUT", "/forms/about", {"answers": {"age": 33}})
    participant.rate_all()
    path = f"/studies/short/runs/{participant.run_id}/erase"
    assert experimenter.send("POST", path, {"confirm": "yes"}).status_code == 422
    assert experimenter.send("POST", path, {"confirm": participant.run_id}).status_code == 200
    with services.database.read() as session:
        assert session.query(Rating).count() == session.query(FormAnswer).count() == 0
        run = session.query(StudyRun).one()
        assert (run.participant, run.device) == ("erased", {})
        assert run.erased_at is not None
    assert participant.request("GET", "").status_code == 401


def test_no_internet_address_is_stored_anywhere(services: Services, participant: Participant) -> None:
    from server.models.base import Base

    names = {str(column) for table in Base.metadata.tables.values() for column in table.columns}
    names -= {"mailed_links.address"}  # an account's, where letters go to
    assert not [
        name for name in names if name.split(".")[1] in ("ip", "ip_address", "remote_addr", "address")
    ]


def test_a_run_of_another_study_is_not_found(viewer: Admin, study: StudyInDatabase) -> None:
    answer = viewer.get("/studies/short/runs/nothing")
    assert (answer.status_code, answer.json()["error"]["code"]) == (404, "not_found")
