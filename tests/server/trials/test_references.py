"""Degradation category rating through the API: both clips judged, exported, simulated, analysed."""

import csv
import json
import uuid
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from analysis.cli import app
from server.context import Services
from server.exports.formats import FORMATS
from server.exports.schemas import Extract
from server.models import Study, StudyRun
from server.participation import rating_repository
from server.rehearsals.person import Person, Rater
from tests.conftest import REPOSITORY
from tests.helpers.simulated import Api, levels_by_clip
from tests.helpers.studies import Participant, StudyInDatabase, add_study, good_playback

DEMO = REPOSITORY / "experiments" / "dcr-demo.toml"


@pytest.fixture
def degraded(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", DEMO.read_text(encoding="utf-8"))


@pytest.fixture
def judge(client: TestClient, degraded: StudyInDatabase) -> Participant:
    return Participant(client, degraded.link_token).agree()


def mains(participant: Participant) -> list[Any]:
    return [trial for trial in participant.state()["trials"] if trial["kind"] == "main"]


def rate(participant: Participant, trial: Any, clips: dict[str, Any] | None, drawn: int | None = None) -> Any:
    each = {
        clip["role"]: {
            "clip_sha256": clip["clip_sha256"],
            "frames_drawn": clip["frames"],
            "frames_missing": 0,
        }
        for clip in trial["clips"]
    }
    log = [[index, 40.0 * index] for clip in trial["clips"] for index in range(clip["frames"])][:drawn]
    body = {
        "trial_index": trial["trial_index"],
        "answer": {"kind": "clip_rating", "answers": {"rating": {"response": 4}}, "reference_gap_ms": 2016.7},
        "playback": {**good_playback(trial), "frames_drawn": 8, "drawn": log, "clips": each | (clips or {})},
    }
    return participant.request("PUT", f"/ratings/{uuid.uuid4()}", body)


def exported(services: Services, study: StudyInDatabase) -> str:
    with services.database.read() as session:
        named = session.query(Study).filter_by(name=study.name).one()
        return b"".join(FORMATS["csv"](session, named, Extract("all"))).decode()


def test_both_clips_are_stored_judged_and_exported(
    judge: Participant, services: Services, degraded: StudyInDatabase
) -> None:
    trial = mains(judge)[0]
    assert [clip["role"] for clip in trial["clips"]] == ["shown", "reference"]
    assert trial["clip_sha256"] == trial["clips"][0]["clip_sha256"]
    receipt = rate(judge, trial, None).json()["receipt"]
    assert (receipt["verdict"], receipt["rule"]) == ("good", "")
    (row,) = csv.DictReader(exported(services, degraded).splitlines())
    assert (row["reference"], row["reference_gap_ms"], row["response"]) == ("both", "2016.7", "4")
    assert row["lower_lid"] in {"both", "vertical", "none"}


def test_a_wrong_reference_fails_and_a_log_without_it_is_flagged(judge: Participant) -> None:
    first, second, third = mains(judge)[:3]
    other = {"clip_sha256": "0" * 64, "frames_drawn": 4, "frames_missing": 0}
    rulings = [
        rate(judge, first, {"reference": other}),
        rate(judge, second, {"reference": None}),
        rate(judge, third, None, 4),
    ]
    assert [
        (answer.json()["receipt"]["verdict"], answer.json()["receipt"]["rule"]) for answer in rulings
    ] == [
        ("failed", "wrong_clip"),
        ("failed", "wrong_clip"),
        ("flagged", "frame_log_disagrees"),
    ]


def test_the_digest_is_over_the_clips_in_the_order_the_page_has_them(
    judge: Participant, services: Services
) -> None:
    told = mains(judge)[0]
    with services.database.read() as session:
        run = session.query(StudyRun).one().id
        stored = rating_repository.trial(session.connection(), run, told["trial_index"])
    assert stored is not None
    assert list(stored.clips) == [clip["role"] for clip in told["clips"]] == ["shown", "reference"]


def test_a_gap_without_a_reference_is_refused(participant: Participant) -> None:
    participant.agree()
    trial = mains(participant)[0]
    answer = {"kind": "clip_rating", "answers": {"rating": {"response": 4}}, "reference_gap_ms": 5.0}
    body = {"trial_index": trial["trial_index"], "answer": answer, "playback": good_playback(trial)}
    refused = participant.request("PUT", f"/ratings/{uuid.uuid4()}", body)
    assert (refused.status_code, refused.json()["error"]["code"]) == (422, "no_reference")


@pytest.mark.usefixtures("one_seed")
def test_simulated_people_are_analysed_with_differential_scores(
    client: TestClient, services: Services, degraded: StudyInDatabase, tmp_path: Path
) -> None:
    levels, link = levels_by_clip(services), degraded.link(synthetic=True)
    for seed in range(6):
        assert Person(Api(client), Rater(seed, 1, levels)).take_part(link)
    path, out = tmp_path / "ratings.csv", tmp_path / "out"
    path.write_text(exported(services, degraded), encoding="utf-8")
    options = ["--csv", str(path), "--origin", "simulated", "--out", str(out), "--no-sensitivity"]
    done = CliRunner().invoke(app, ["run", str(DEMO), *options])
    assert done.exit_code == 0, done.output
    every = json.loads((out / "results.json").read_text(encoding="utf-8"))["degradation"]
    assert [one["cell"] for one in every] == ["both", "vertical", "none"]
    assert [one["differential"] is None for one in every] == [True, False, False]
    assert all(1 <= one["dmos"] <= 5 for one in every)
    assert "Degradation mean opinion scores" in (out / "report.md").read_text(encoding="utf-8")
