"""The sealed plan on the dashboard."""

from experiments.seal import Seal
from tests.helpers.admins import Admin
from tests.helpers.studies import Participant, StudyInDatabase

POWER = {"power": {"speed": 0.91}}


def test_a_plan_is_sealed_with_its_power_once_and_taken_away(
    experimenter: Admin, study: StudyInDatabase
) -> None:
    unsealed = experimenter.get("/studies/short/seal").json()
    assert (unsealed["sealed_at"], unsealed["participants"]) == (None, 0)
    assert experimenter.get("/studies/short/seal/plan.json").status_code == 404
    made = experimenter.send("POST", "/studies/short/seal", {"power": POWER})
    assert made.status_code == 201, made.text
    assert (made.json()["version"], made.json()["power"]) == (1, True)
    data = experimenter.get("/studies/short/seal/plan.json").json()
    assert data.pop("sha256") == made.json()["sha256"] == Seal.model_validate(data).sha256
    assert data["power"] == POWER
    assert made.json()["sha256"] in experimenter.get("/studies/short/seal/plan.html").text
    assert experimenter.send("POST", "/studies/short/seal", {}).status_code == 409


def test_after_the_first_participant_nothing_is_sealed(experimenter: Admin, participant: Participant) -> None:
    participant.agree()
    assert experimenter.get("/studies/short/seal").json()["participants"] == 1
    refused = experimenter.send("POST", "/studies/short/seal", {"power": None})
    assert (refused.status_code, "sealed before the first" in refused.text) == (409, True)


def test_a_viewer_seals_nothing(viewer: Admin, study: StudyInDatabase) -> None:
    assert viewer.send("POST", "/studies/short/seal", {}).status_code == 403
    assert viewer.get("/studies/short/seal").status_code == 200
