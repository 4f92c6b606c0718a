"""What a column's name says, and series that are high where the lids are shut."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.columns import eye_of, is_high_when_shut
from stimuli_builder.blinks.series import read_series


@pytest.mark.parametrize(
    ("name", "eye"),
    [
        *(
            (name, "left")
            for name in ("EAR_l", "l_ear", "left_ear", "ear_left", "leftEAR", "EAR left", "EARleft")
        ),
        *(
            (name, "left")
            for name in ("eyeBlinkLeft", "EAR2D6_l", "left_distance_px", "leftEye EAR", "L", "lefteye_gap")
        ),
        *(
            (name, "right")
            for name in ("eyeblinkright", "EAR_r", "r_ear", "rightEAR", "EAR.right", "EyeBlinkRight", "EAR-R")
        ),
        *(
            (name, None)
            for name in ("AU45_r", "AU45_c", "EAR", "distance_px", "brightness", "level", "left_right", "")
        ),
        *(
            (name, None)
            for name in (
                "L2_distance",
                "ear_L1",
                "d_r_squared",
                "leftover_px",
                "rightmost_x",
                "AU45_r_smooth",
            )
        ),
    ],
)
def test_the_eye_is_read_from_the_words_of_a_name(name: str, eye: str | None) -> None:
    assert eye_of(name) == eye


@pytest.mark.parametrize(
    ("name", "shut"),
    [
        *(
            (name, True)
            for name in ("eyeBlinkLeft", "EyeBlinkRight", "AU45_r", "closure_left", "gap_l_closure")
        ),
        *((name, False) for name in ("EAR_l", "AU04_r", "opening", "left_distance_px", "enclosed")),
        *((name, False) for name in ("blink_distance", "left_blink_EAR", "eye_closed_distance", "closed_px")),
    ],
)
def test_a_closure_is_read_from_its_name(name: str, shut: bool) -> None:
    assert is_high_when_shut(name) is shut


@pytest.mark.parametrize("top", [1.0, 3.2])
def test_a_closure_is_turned_round_and_said(stimuli, make_known, tmp_path: Path, top: float) -> None:
    closure = top * (1 - make_known(noise=0.05).distance / 34.2)
    pd.DataFrame({"eyeBlinkLeft": closure}).to_csv(tmp_path / "s.csv", index=False)
    arguments = ("--column", "eyeBlinkLeft", "--fps", 300, "--out", tmp_path / "b.csv")
    ended = stimuli("blinks", tmp_path / "s.csv", *arguments)
    assert ended.code == 0, ended.err
    assert "'eyeBlinkLeft' is high when lids are closed, as its name says" in ended.err
    assert pd.read_csv(tmp_path / "b.csv")["minimum_s"].to_list() == pytest.approx([2, 4, 6, 8], abs=0.02)


def test_what_looks_like_a_closure_waits_for_a_word(stimuli, make_known, tmp_path: Path) -> None:
    pd.DataFrame({"a": 1 - make_known(noise=0.05).distance / 34.2}).to_csv(tmp_path / "s.csv", index=False)
    arguments = ("--column", "a", "--fps", 300, "--out", tmp_path / "b.csv")
    ended = stimuli("blinks", tmp_path / "s.csv", *arguments)
    assert ended.code != 0
    assert "add --inverted if high means closed, --not-inverted if high means open" in ended.err
    assert stimuli("blinks", tmp_path / "s.csv", *arguments, "--inverted").code == 0
    assert len(pd.read_csv(tmp_path / "b.csv")) == 4


def test_an_opening_under_a_closures_name_is_left_as_it_is_on_request(make_known, tmp_path: Path) -> None:
    distance = make_known().distance
    pd.DataFrame({"eyeBlinkLeft": distance}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["eyeBlinkLeft"], 300, inverted=False)
    assert series.distance == pytest.approx(distance)
    assert series.notes == ()


@pytest.mark.parametrize("part", [0.0, 0.3, 0.7])
def test_an_opening_is_not_taken_for_a_closure(make_known, tmp_path: Path, part: float) -> None:
    distance = make_known(noise=0.5).distance + 8.0  # lids that meet leave an eye aspect ratio above 0
    distance[: round(part * distance.size)] = 8.0
    pd.DataFrame({"gap": distance}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["gap"], 300)
    assert series.distance == pytest.approx(distance)
    assert series.notes == ()


def test_an_opening_that_is_named_as_a_closure_waits_for_a_word(make_known, tmp_path: Path) -> None:
    pd.DataFrame({"eyeBlinkLeft": make_known(noise=0.05).distance}).to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match=r"is named as a closure .* near its maximum, like an opening"):
        read_series(tmp_path / "s.csv", ["eyeBlinkLeft"], 300)


def test_a_glitch_is_not_a_level_of_a_shut_lid(make_known, tmp_path: Path) -> None:
    closure = 1 - make_known(noise=0.05).distance / 34.2
    closure[700:702] = 40.0
    pd.DataFrame({"closure": closure}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["closure"], 300)
    assert series.distance.max() == pytest.approx(1.0, abs=0.02)
    assert series.distance.min() >= 0


def test_columns_without_a_side_are_not_said_to_blink_apart(
    stimuli, series_file: Path, tmp_path: Path
) -> None:
    table = pd.read_csv(series_file).rename(columns={"gap_l": "one", "gap_r": "two"})
    table.to_csv(tmp_path / "s.csv", index=False)
    files = ("--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", tmp_path / "s.csv", "--column", "one", "--column", "two", "--fps", 300, *files)
    assert ended.code == 0, ended.err
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "blinks are not paired" in page
    assert "in both eyes" not in page


def test_words_in_place_of_a_closure_are_refused(tmp_path: Path) -> None:
    pd.DataFrame({"eyeBlinkLeft": ["x"] * 400}).to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match="must have numbers"):
        read_series(tmp_path / "s.csv", ["eyeBlinkLeft"], 240)


@pytest.mark.parametrize("top", [1.0, 5.0, 100.0])
def test_an_eye_that_closes_less_keeps_to_be_seen_as_such(make_known, tmp_path: Path, top: float) -> None:
    closure = top * (1 - make_known(noise=0.05).distance / 34.2)
    table = pd.DataFrame({"closure_left": closure, "closure_right": 0.2 * closure})
    table.to_csv(tmp_path / "s.csv", index=False)
    left, right = read_series(tmp_path / "s.csv", list(table.columns), 300)
    assert np.ptp(right.distance) == pytest.approx(0.2 * np.ptp(left.distance), rel=0.01)
    assert np.median(right.distance) == pytest.approx(np.median(left.distance), rel=0.03)
