"""A palsied eye, or a column that says nothing, hides no blink of the other eye, and is named."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench.lid_event_training import Motion, course, plan
from stimuli_builder.blinks.both_eyes import asymmetry_lines
from stimuli_builder.blinks.events.recognise import RecognisedEvents, recognise
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.labelling import LabelOptions
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries

SECONDS = 30.0


def face(seed: int, fps: float, share: float, noise: float = 0.02) -> tuple[list[Motion], list[Array]]:
    """Events of a face, and both eyes' distances: the second moves by a share of the first."""
    rng = np.random.default_rng([seed, 962])
    motions = plan(SECONDS, rng)
    times = np.arange(round(SECONDS * fps)) / fps
    opened = np.ones(times.size)
    for motion in motions:
        opened *= 1 - np.clip(course(motion, times, np.random.default_rng(seed)), 0, 1)
    shut = 0.8 * (1 - opened)
    eyes = [1 - shut * part + rng.normal(0, noise, times.size) for part in (1.0, share)]
    return motions, [np.maximum(eye, 0) * 0.3 for eye in eyes]


def recognised(eyes: list[Array], fps: float) -> list[RecognisedEvents]:
    return recognise([BlinkSeries(distance=eye, fps=fps, column="d", is_px=False) for eye in eyes])


def blinks(one: RecognisedEvents) -> list[float]:
    return [event.minimum_s for event in one.events if event.kind == "blink"]


@pytest.mark.parametrize(("seed", "fps"), [(1, 30.0), (2, 60.0), (3, 120.0), (4, 240.0)])
@pytest.mark.parametrize("noise", [0.004, 0.03])
def test_the_eye_that_moves_is_reported_as_if_it_were_alone(seed: int, fps: float, noise: float) -> None:
    motions, (moving, still) = face(seed, fps, 0.0, noise)
    (alone,) = recognised([moving], fps)
    assert len(blinks(alone)) >= 0.7 * sum(motion.kind == "blink" for motion in motions)
    for eyes, number in (([moving, still], 0), ([still, moving], 1)):
        told = recognised(eyes, fps)
        assert told[number].events == alone.events
        assert blinks(told[1 - number]) == []
        side = told[1 - number].asymmetry
        assert side is not None
        assert side.is_weak
        assert not side.moves


@pytest.mark.parametrize("value", [0.0, 0.3])
def test_a_column_of_one_value_hides_no_blink(value: float) -> None:
    _, (moving, _) = face(5, 60.0, 0.0)
    told = recognised([np.full(moving.size, value), moving], 60.0)
    assert told[1].events == recognised([moving], 60.0)[0].events
    assert blinks(told[0]) == []


@pytest.mark.parametrize(("seed", "share"), [(6, 0.15), (7, 0.2), (8, 0.3)])
def test_an_eye_that_moves_a_little_is_reported_with_its_share(seed: int, share: float) -> None:
    _, eyes = face(seed, 120.0, share, 0.006)
    strong, weak = recognised(eyes, 120.0)
    assert strong.events == recognised(eyes[:1], 120.0)[0].events
    side = weak.asymmetry
    assert side is not None
    assert side.moves
    assert side.is_weak
    assert side.share == pytest.approx(share, abs=0.03)
    assert len(blinks(weak)) >= 0.5 * len(blinks(strong))  # the other eye says when to look


@pytest.mark.parametrize("share", [0.7, 1.0])
def test_eyes_that_both_move_are_judged_together(share: float) -> None:
    _, eyes = face(9, 60.0, share, 0.03)
    left, right = recognised(eyes, 60.0)
    assert left.asymmetry is not None
    assert right.asymmetry is not None
    assert not left.asymmetry.is_weak
    assert not right.asymmetry.is_weak
    assert right.asymmetry.share == pytest.approx(share, abs=0.15)


def test_an_eye_not_seen_at_the_others_blinks_is_not_a_still_one() -> None:
    _, (left, right) = face(10, 60.0, 1.0)
    right[120:] = np.nan  # seen for the first two seconds alone
    told = recognised([left, right], 60.0)
    side = told[1].asymmetry
    assert side is None or side.moves


@pytest.fixture
def palsy(tmp_path: Path) -> Path:
    _, (moving, still) = face(3, 120.0, 0.0, 0.01)
    path = tmp_path / "palsy.csv"
    pd.DataFrame({"EAR_l": still, "EAR_r": moving}).to_csv(path, index=False)
    return path


def test_the_still_eye_is_named_on_screen_in_report_and_summary(stimuli, palsy: Path, tmp_path: Path) -> None:
    ended = stimuli(
        "blinks", palsy, "--column", "EAR_l", "--column", "EAR_r", "--fps", 120, "--out", tmp_path / "b.csv",
        "--report", tmp_path / "r.html", "--summary", tmp_path / "s.json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    expected = "left eye (EAR_l): does not move beyond its noise at the other eye's"
    assert expected in ended.err
    page = (tmp_path / "r.html").read_text(encoding="utf-8").replace("&#39;", "'")
    assert expected in page
    left, right = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))["columns"]
    assert left["asymmetry"]["moves"] is False
    assert left["blinks"] == 0
    assert right["blinks"] == len(blinks(recognised([face(3, 120.0, 0.0, 0.01)[1][0]], 120.0)[0])) >= 3
    assert "nan" not in ended.out


def lines_of(told: list[RecognisedEvents], eyes: list[Array], columns: tuple[str, str]) -> list[str]:
    series = [
        BlinkSeries(distance=eye, fps=120.0, column=name, is_px=False)
        for eye, name in zip(eyes, columns, strict=True)
    ]
    return asymmetry_lines(
        [blinks_of(one, LabelOptions(), recognised=seen) for one, seen in zip(series, told, strict=True)]
    )


def test_an_eye_that_blinks_is_not_named_for_a_glitch_of_the_other() -> None:
    _, (moving, still) = face(3, 120.0, 0.0, 0.006)
    still[1000:1030] -= 0.2 * np.hanning(30)
    lines = lines_of(recognised([still, moving], 120.0), [still, moving], ("EAR_l", "EAR_r"))
    assert not any(line.startswith("right eye") for line in lines)


def test_columns_that_are_not_both_eyes_are_not_called_so() -> None:
    _, eyes = face(3, 120.0, 0.0, 0.01)
    (line,) = lines_of(recognised(eyes, 120.0), eyes, ("EAR_r", "EAR_r_still"))
    assert "the other column's" in line
    assert "other eye" not in line
