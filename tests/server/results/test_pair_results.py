"""Results of paired comparisons, against the exported rows counted by hand."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from server.context import Services
from server.results import kinds
from tests.helpers.admins import Admin
from tests.helpers.comparisons import comparisons
from tests.helpers.studies import Participant, StudyInDatabase, add_study
from tests.server.trials.test_comparisons import PAIRS, compare, mains


@pytest.fixture
def pairs(services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", PAIRS)


@pytest.fixture
def answered(client: TestClient, pairs: StudyInDatabase) -> None:
    for answers in (("left", "left", "tie"), ("right", "left", "left")):
        person = Participant(client, pairs.link_token).agree()
        for place, trial in enumerate(mains(person)):
            assert compare(person, trial, answers[place % 3]).status_code == 201


@pytest.fixture
def results(viewer: Admin, answered: None) -> dict[str, Any]:
    shown: dict[str, Any] = viewer.get("/studies/short/results").json()
    return shown


def test_every_pair_of_cells_has_its_choices(results: dict[str, Any], services: Services) -> None:
    with services.database.read() as session:
        rows = [row for row in comparisons(session) if row["kind"] == "main"]
    expected = Counter[tuple[str, str, str]]()
    for row in rows:
        left, right = row["left_cell"], row["right_cell"]
        chosen = {"left": left, "right": right, "tie": "tie"}[row["winner"]]
        expected[(*sorted((left, right)), chosen)] += 1
    shown = Counter[tuple[str, str, str]]()
    for pair in results["pairs"]:
        key = tuple(sorted((pair["first"], pair["second"])))
        shown[(*key, pair["first"])] += pair["first_chosen"]
        shown[(*key, pair["second"])] += pair["second_chosen"]
        shown[(*key, "tie")] += pair["ties"]
        assert pair["n"] == pair["first_chosen"] + pair["second_chosen"] + pair["ties"]
    assert +shown == expected
    assert (results["kind"], results["participants"], results["ratings"]) == (
        "paired_comparison",
        2,
        len(rows),
    )
    assert results["left"] == sum(row["winner"] == "left" for row in rows)


def test_a_timeline_has_both_clips_and_every_time(viewer: Admin, answered: None, services: Services) -> None:
    with services.database.read() as session:
        rows = comparisons(session)
    exported = {(row["run"], row["trial_index"], row["play"]): row for row in rows}
    lines = viewer.get("/studies/short/data/raw.ndjson").text.splitlines()[:-1]
    plays = [(run["summary"]["run"], play) for run in map(json.loads, lines) for play in run["trials"]]
    assert len(plays) == len(exported)
    for run, play in plays:
        row = exported[run, play["trial_index"], play["play"]]
        clips = {
            clip["role"]: (clip["cell"], clip["exemplar"], clip["clip_sha256"]) for clip in play["clips"]
        }
        for side in clips:
            names = (f"{side}_cell", f"{side}_exemplar", f"{side}_clip_sha256")
            assert clips[side] == tuple(row[name] for name in names)
        assert set(clips) == (set() if play["kind"] == "attention" else {"left", "right"})
        for name in ("rt", "rt_from_first_frame", "time_elapsed", "changes", "stalls", "clock_gap_ms"):
            assert play[name] == row[name]


def test_a_level_is_compared_with_other_levels_only(results: dict[str, Any], services: Services) -> None:
    with services.database.read() as session:
        rows = [row for row in comparisons(session) if row["kind"] == "main"]
    levels = {(level["factor"], level["level"]): level for level in results["levels"]}
    assert levels["speed", "slow"]["n"] == 0
    assert levels["speed", "slow"]["share"] is None
    won = 0.0
    for row in rows:
        first = "left" if row["left_cell"].startswith("a/") else "right"
        won += 1.0 if row["winner"] == first else 0.5 if row["winner"] == "tie" else 0.0
    assert levels["character", "a"]["n"] == len(rows)
    assert levels["character", "a"]["share"] == pytest.approx(won / len(rows))
    other = levels["character", "b"]["share"]
    assert other == pytest.approx(1 - won / len(rows))


def test_a_kind_without_a_summary_says_so(
    answered: None, services: Services, viewer: Admin, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_a_file = kinds.summary_of("of_the_future")
    monkeypatch.setattr("server.results.kinds.summary_of", lambda _: without_a_file)
    shown = viewer.get("/studies/short/results").json()
    with services.database.read() as session:
        number = sum(row["kind"] == "main" for row in comparisons(session))
    assert (shown["kind"], shown["ratings"], shown["participants"]) == ("other", number, 2)
    assert shown["note"].startswith("Answers of paired comparison trials as numbers, by cell")
    assert sum(shown["playback"]["verdicts"].values()) == number
