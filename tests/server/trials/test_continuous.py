"""Continuous ratings over HTTP: checked at the door, stored, exported, and the lag of people found."""

import csv
import io
import json
import re
import uuid
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from analysis.plans.plan import plan_of, study_contents
from analysis.read.study_answers import load_csv
from experiments.kinds.continuous_rating import CONTINUOUS_RATING
from server.context import Services
from server.exports.formats import FORMATS
from server.exports.schemas import ExportOrigin, Extract
from server.models import Study
from server.participation.kinds.continuous_rating import LAG_S
from server.rehearsals.person import Person, Rater
from tests.helpers.simulated import Api
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback

STUDY = re.sub(r"(?s)\[trial\].*?(?=\[\[exclusions)", lambda _: CONTINUOUS_RATING.example + "\n", SHORT)
BLINKS_S, FRAMES = (1.3, 4.1, 6.6), 300
VALUES = [50.0 + index % 7 for index in range(100)]


@pytest.fixture
def study(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", STUDY, frames=FRAMES, blinks_s=BLINKS_S)


def send(participant: Participant, trial: Any, given: dict[str, Any]) -> Any:
    body = {
        "trial_index": trial["trial_index"],
        "play": 1,
        "answer": {"kind": "continuous_rating", **given},
        "rt": None,
        "playback": good_playback(trial),
    }
    return participant.request("PUT", f"/ratings/{uuid.uuid4()}", body)


def exported(services: Services, origin: ExportOrigin) -> bytes:
    with services.database.read() as session:
        stored = session.query(Study).one()
        return b"".join(FORMATS["csv"](session, stored, Extract(origin)))


def test_a_trace_is_checked_stored_and_exported(
    client: TestClient, services: Services, study: StudyInDatabase
) -> None:
    participant = Participant(client, study.link_token).agree()
    trial = next(one for one in participant.state()["trials"] if one["kind"] == "main")
    for given, code in (
        ({"values": [*VALUES[:-1], 101.0], "step_frames": 3}, "rating_out_of_scale"),
        ({"values": VALUES}, "trace_missing"),
        ({"chosen": 3}, "trace_missing"),
    ):
        refused = send(participant, trial, given)
        assert (refused.status_code, refused.json()["error"]["code"]) == (422, code)
    assert send(participant, trial, {"values": [0.0] * 1801, "step_frames": 3}).status_code == 422
    saved = send(participant, trial, {"values": VALUES, "step_frames": 3, "moves": 2})
    assert saved.json()["receipt"]["verdict"] == "good"
    (row,) = csv.DictReader(io.StringIO(exported(services, "participant").decode("utf-8-sig")))
    assert json.loads(row["trace"]) == VALUES
    assert json.loads(row["blinks_s"]) == list(BLINKS_S)
    assert (row["step_frames"], float(row["clip_fps"]), row["moves"]) == ("3", 30.0, "2")
    assert float(row["response"]) == pytest.approx(sum(VALUES) / 100, abs=1e-3)


def test_a_trace_of_another_length_fails_its_play(client: TestClient, study: StudyInDatabase) -> None:
    participant = Participant(client, study.link_token).agree()
    trial = next(one for one in participant.state()["trials"] if one["kind"] == "main")
    receipt = send(participant, trial, {"values": VALUES[:50], "step_frames": 3}).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"], receipt["again"]) == ("failed", "wrong_trace", True)


def test_the_analysis_recovers_the_lag_of_simulated_people(
    client: TestClient, services: Services, study: StudyInDatabase, tmp_path: Path
) -> None:
    link = study.link(synthetic=True)
    with services.database.read() as session:
        clips = {
            clip.clip_sha256: clip.blinks_s or [] for clip in session.query(Study).one().versions[0].clips
        }
    assert set(map(tuple, clips.values())) == {BLINKS_S}
    for seed in range(4):
        rater = Rater(seed, 1, {}, blinks_of=clips)
        assert Person(Api(client), rater).take_part(link)
    path = tmp_path / "traces.csv"
    path.write_bytes(exported(services, "simulated"))
    answers = load_csv(path, study.experiment, plan_of("continuous_rating").reading)
    contents = study_contents(study.experiment, answers)
    lag = contents.numbers["lag"]
    assert lag["lag_s"] == pytest.approx(LAG_S + 0.1, abs=0.151)
    assert lag["p"] < 0.01
    assert [cell["people"] for cell in contents.numbers["cells"]] == [4] * 4
    assert "Ratings changed" in contents.parts[0].sentences[0]
    pictures = contents.parts[0].draw()
    assert [picture.key for picture in pictures] == ["figure-traces", "figure-lag"]
    assert all(picture.png.startswith(b"\x89PNG") for picture in pictures)
