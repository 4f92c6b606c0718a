"""Several scales per clip through the API: checked, stored, exported with one row per scale, summed up."""

import csv
import io
import re
import uuid
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from server.context import Services
from server.exports.formats import FORMATS, row_count
from server.exports.schemas import Extract
from server.models import Rating, Study
from server.rehearsals.person import Person, Rater
from tests.helpers.admins import Admin
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback

SCALES = """\
[trial]

[[trial.scales]]
name = "natural"
maximum = 5
question = { en = "How natural?", de = "Wie natürlich?" }
low = { en = "not", de = "nicht" }
high = { en = "very", de = "sehr" }

[[trial.scales]]
name = "eerie"
type = "slider"
step = 0.5
reverse = true
question = { en = "How eerie?", de = "Wie unheimlich?" }
low = { en = "not", de = "nicht" }
high = { en = "very", de = "sehr" }
not_applicable = { en = "I cannot say", de = "Weiß nicht" }

"""
STUDY = re.sub(r"(?s)\[trial\].*?(?=\[\[exclusions)", lambda _: SCALES, SHORT)
GIVEN = {"natural": {"response": 4, "rt": 812.5}, "eerie": {"response": 62.5, "rt": 1500.0}}
NEITHER = {"response": None, "not_applicable": True}


@pytest.fixture
def scales(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", STUDY)


@pytest.fixture
def rater(client: TestClient, scales: StudyInDatabase) -> Participant:
    return Participant(client, scales.link_token).agree()


def answer(participant: Participant, trial: Any, answers: dict[str, Any]) -> Any:
    body = {
        "trial_index": trial["trial_index"],
        "play": 1,
        "answer": {"kind": "clip_rating", "answers": answers},
        "rt": 1500.0,
        "playback": good_playback(trial),
    }
    return participant.request("PUT", f"/ratings/{uuid.uuid4()}", body)


def mains(participant: Participant) -> list[Any]:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"]


def test_each_scale_is_a_row_and_what_does_not_apply_is_not_a_number(
    rater: Participant, services: Services
) -> None:
    first, second, *_ = mains(rater)
    assert answer(rater, first, GIVEN).status_code == 201
    assert answer(rater, second, {**GIVEN, "eerie": NEITHER}).status_code == 201
    with services.database.read() as session:
        stored = session.query(Rating).order_by(Rating.id).all()
        assert stored[0].payload == {"answers": GIVEN}
        assert stored[1].payload["answers"]["eerie"] == NEITHER
        query = "SELECT trial_index, scale, response, not_applicable, scale_rt FROM ratings ORDER BY 1, 2"
        rows = [(row[1], row[2] and float(row[2]), bool(row[3])) for row in session.execute(text(query))]
        study = session.query(Study).one()
        content = b"".join(FORMATS["csv"](session, study, Extract("participant"))).decode()
        codebook = b"".join(FORMATS["codebook"](session, study, Extract("participant"))).decode()
        assert row_count("csv", session, study, Extract("participant")) == 4
    assert sorted(rows, key=str) == sorted(
        [("eerie", 62.5, False), ("natural", 4.0, False), ("eerie", None, True), ("natural", 4.0, False)],
        key=str,
    )
    lines = list(csv.DictReader(io.StringIO(content)))
    assert sorted((line["scale"], line["response"], line["not_applicable"]) for line in lines) == [
        ("eerie", "", "1"),
        ("eerie", "62.5", "0"),
        ("natural", "4", "0"),
        ("natural", "4", "0"),
    ]
    assert "`eerie`: Scale: 0 (not) to 100 (very)." in codebook
    assert "Reverse-keyed: a high answer means a low value; answers are stored as chosen." in codebook


@pytest.mark.parametrize(
    ("answers", "code", "said"),
    [
        ({"natural": {"response": 4}}, "rating_missing", "Expected an answer on eerie, got none"),
        ({**GIVEN, "eery": {"response": 1}}, "no_such_scale", "the scales natural, eerie; got one on eery"),
        ({**GIVEN, "natural": {"response": 6}}, "rating_out_of_scale", "whole number from 1 to 5 on natural"),
        ({**GIVEN, "eerie": {"response": 100.5}}, "rating_out_of_scale", "from 0 to 100 on eerie, got 100.5"),
        ({**GIVEN, "eerie": {"response": 62.2}}, "rating_out_of_scale", "a number in steps of 0.5"),
        (
            {**GIVEN, "natural": NEITHER},
            "rating_out_of_scale",
            "got not_applicable, which this scale does not offer",
        ),
        ({**GIVEN, "natural": {"response": "4"}}, "invalid", "natural"),
        ({**GIVEN, "eerie": {"response": 4, "not_applicable": True}}, "invalid", "got both"),
        ({}, "invalid", "answers"),
    ],
)
def test_what_is_not_an_answer_is_refused_in_one_line(
    rater: Participant, answers: dict[str, Any], code: str, said: str
) -> None:
    refused = answer(rater, mains(rater)[0], answers)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, code)
    assert said in refused.json()["error"]["message"]
    assert "\n" not in refused.json()["error"]["message"]


def test_a_clip_that_failed_goes_without_any_answer_but_not_without_some(rater: Participant) -> None:
    trial = mains(rater)[0]
    none = {"natural": {"response": None}, "eerie": {"response": None}}
    assert answer(rater, trial, {**none, "natural": {"response": 3}}).status_code == 422
    receipt = answer(rater, trial, none).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"]) == ("failed", "not_rated")


def test_a_simulated_person_answers_every_scale_and_results_show_the_one_chosen(
    client: TestClient, services: Services, scales: StudyInDatabase, experimenter: Admin
) -> None:
    person = Person(Api(client), Rater(1, 1, {}))
    assert person.take_part(scales.link(synthetic=True))
    with services.database.read() as session:
        query = text("SELECT kind, scale, response, expected_response FROM ratings")
        rows = [tuple(row) for row in session.execute(query)]
    assert {row[1] for row in rows if row[0] == "main"} == {"natural", "eerie"}
    checks = [row for row in rows if row[0] == "attention"]
    assert checks
    assert all(row[1] is None and row[2] == row[3] for row in checks)
    path = f"/studies/{scales.name}/results?origin=simulated"
    first, chosen = experimenter.get(path).json(), experimenter.get(f"{path}&scale=eerie").json()
    assert (first["scale"]["name"], first["bins"]) == ("natural", [1.0, 2.0, 3.0, 4.0, 5.0])
    assert (chosen["scale"]["name"], chosen["scale"]["reverse"], len(chosen["bins"])) == ("eerie", True, 20)
    assert [scale["name"] for scale in first["scales"]] == ["natural", "eerie"]
    refused = experimenter.get(f"{path}&scale=eery")
    assert refused.status_code == 422
    assert "has no scale 'eery'; did you mean 'eerie'?" in refused.json()["error"]["message"]
