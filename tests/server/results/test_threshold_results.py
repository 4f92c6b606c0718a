"""Results of adaptive series, against the exported rows counted by hand."""

import json
from collections import Counter
from itertools import product
from pathlib import Path
from statistics import NormalDist, mean, stdev
from typing import Any

import pytest
from fastapi.testclient import TestClient

from experiments.kinds.threshold_grid import model
from server.context import Services
from server.models import StudyRun
from tests.helpers.admins import Admin
from tests.helpers.studies import SHORT, Participant, StudyInDatabase, add_study, good_playback
from tests.helpers.thresholds import TWO_INTERVAL, YES_NO, text_with, thresholds
from tests.server.trials.test_thresholds import answer, mains


@pytest.fixture(params=[YES_NO, TWO_INTERVAL], ids=["yes_no", "two_interval"])
def study(request: pytest.FixtureRequest, services: Services, tmp_path: Path) -> StudyInDatabase:
    return add_study(services, tmp_path / "clips", text_with(SHORT, request.param))


def played(trial: Any) -> dict[str, Any]:
    """A good play of the trial's one clip, or of both in turn."""
    if len(trial["clips"]) == 1:
        return good_playback(trial)
    both = {"frames": sum(clip["frames"] for clip in trial["clips"])}
    clips = {
        clip["role"]: {
            "clip_sha256": clip["clip_sha256"],
            "frames_drawn": clip["frames"],
            "frames_missing": 0,
        }
        for clip in trial["clips"]
    }
    return {**good_playback({**trial, **both}), "clips": clips}


def observe(person: Participant, number: int, names: tuple[str, str]) -> None:
    """Answer the next trial of the run a few times, the two answers in a fixed pattern."""
    for place in range(number):
        trial = next(one for one in mains(person.state()) if not one["answered"])
        saved = answer(person, trial, names[(place // 2) % 2], playback=played(trial))
        assert saved.status_code == 201, saved.text


@pytest.fixture
def answered(client: TestClient, study: StudyInDatabase) -> StudyInDatabase:
    trial: Any = study.experiment.trial
    names = ("yes", "no") if trial.task.asks == "yes_no" else ("first", "second")
    for number in (7, 5, 4):
        observe(Participant(client, study.link_token).agree(), number, names)
    return study


def test_each_series_has_its_answers_by_stimulus_and_the_peoples_thresholds(
    answered: StudyInDatabase, services: Services, viewer: Admin
) -> None:
    with services.database.write() as session:
        last = session.query(StudyRun).order_by(StudyRun.id.desc()).first()
        assert last is not None
        last.excluded = True
        excluded = last.public_id
    with services.database.read() as session:
        rows = [row for row in thresholds(session) if row["kind"] == "main" and row["run"] != excluded]
    shown = viewer.get("/studies/short/results").json()
    assert (shown["kind"], shown["factor"], shown["participants"]) == ("threshold", "duration", 2)
    assert shown["ratings"] == len(rows) == 12
    for one in shown["series_results"]:
        mine = [row for row in rows if row["series"] == one["name"]]
        n, positive = Counter(row["value"] for row in mine), Counter[float]()
        latest: dict[str, tuple[int, float, float]] = {}
        for row in mine:
            positive[row["value"]] += row["correct"]
            place = (row["trial_index"], row["threshold"], row["threshold_sd"])
            latest[row["run"]] = max(latest.get(row["run"], place), place)
        assert {(s["value"], s["n"], s["positive"]) for s in one["stimuli"]} == {
            (value, n[value], positive[value]) for value in n
        }
        expected = sorted(threshold for _, threshold, _ in latest.values())
        assert one["thresholds"] == pytest.approx(expected)
        assert (one["people"], one["answers"]) == (2, len(mine))
        assert one["mean"] == pytest.approx(mean(expected))
        assert one["sd"] == pytest.approx(stdev(expected))
        assert one["mean_posterior_sd"] == pytest.approx(mean(sd for *_, sd in latest.values()))


def test_series_without_an_answer_have_no_threshold(study: StudyInDatabase, viewer: Admin) -> None:
    shown = viewer.get("/studies/short/results").json()
    assert [one["levels"] for one in shown["series_results"]] == [
        {"character": "photorealistic"},
        {"character": "cartoon"},
    ]
    assert [(one["people"], one["mean"], one["sd"]) for one in shown["series_results"]] == [
        (0, None, None)
    ] * 2


SECOND = 'second = { factor = "character", values = { photorealistic = 0, cartoon = 1 } }'
PLANE = YES_NO.replace('{ factor = "duration" }', f'{{ factor = "duration", {SECOND} }}')


def test_over_two_factors_answers_are_reported_by_both_numbers(
    client: TestClient, services: Services, viewer: Admin, tmp_path: Path
) -> None:
    study = add_study(services, tmp_path / "clips", text_with(SHORT, PLANE))
    for number in (8, 6):
        observe(Participant(client, study.link_token).agree(), number, ("yes", "no"))
    with services.database.read() as session:
        rows = [row for row in thresholds(session) if row["kind"] == "main"]
    numbers = {"photorealistic": 0.0, "cartoon": 1.0}
    n = Counter((row["value"], numbers[json.loads(row["levels"])["character"]]) for row in rows)
    assert len({second for _, second in n}) == 2, "both characters were shown"
    shown = viewer.get("/studies/short/results").json()
    assert (shown["second_factor"], shown["second_middle"]) == ("character", 0.5)
    [one] = shown["series_results"]
    assert {(s["value"], s["second"]): s["n"] for s in one["stimuli"]} == n
    assert sum(s["positive"] for s in one["stimuli"]) == sum(row["correct"] for row in rows)
    expected = [tilt_by_hand(study, rows, numbers, run) for run in {row["run"] for row in rows}]
    tilt = one["tilt"]
    assert tilt["people"] == 2
    assert tilt["mean"] == pytest.approx(mean(m for m, _ in expected))
    assert tilt["sd"] == pytest.approx(stdev(m for m, _ in expected))
    assert tilt["mean_posterior_sd"] == pytest.approx(mean(sd for _, sd in expected))
    half = 12.7062 * tilt["sd"] / 2**0.5
    assert (tilt["low"], tilt["high"]) == pytest.approx((tilt["mean"] - half, tilt["mean"] + half), rel=1e-4)


def tilt_by_hand(
    study: StudyInDatabase, rows: list[dict[str, Any]], numbers: dict[str, float], run: str
) -> tuple[float, float]:
    """Mean and SD of one person's posterior, from the exported rows and equation (1) alone."""
    assumed = model(study.experiment)
    mine = [row for row in rows if row["run"] == run]
    weights: Counter[float] = Counter()
    for t, s, b in product(assumed.thresholds, assumed.spreads, assumed.tilts):
        likelihood = 1.0
        for row in mine:
            z = numbers[json.loads(row["levels"])["character"]] - 0.5
            p = 0.02 + 0.96 * NormalDist(t + b * z, s).cdf(row["value"])
            likelihood *= p if row["correct"] else 1 - p
        weights[b] += likelihood
    total = sum(weights.values())
    middle = sum(b * w for b, w in weights.items()) / total
    return middle, (sum((b - middle) ** 2 * w for b, w in weights.items()) / total) ** 0.5


def test_along_one_factor_there_is_no_tilt(answered: StudyInDatabase, viewer: Admin) -> None:
    shown = viewer.get("/studies/short/results").json()
    assert [one["tilt"] for one in shown["series_results"]] == [None, None]
