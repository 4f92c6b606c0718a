"""Frames that their table calls not valid are not seen, and doubtful ones are said."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.series import read_series

FPS = 120.0
BAD = slice(300, 420)
"""Between two blinks, at 2 and 4 s; zeros there read as a closed eye."""


def spoilt(make_known, name: str, good: object, bad: object) -> pd.DataFrame:
    """A series whose tracker wrote zeros for a second, and marked them in a column."""
    known = make_known(fps=FPS, noise=0.05)
    distance, column = known.distance.copy(), np.full(known.distance.size, good, dtype=object)
    distance[BAD], column[BAD] = 0.0, bad
    return pd.DataFrame({" gap_l": distance, name: column})


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [(" success", 1, 0), ("valid", True, False), ("Valid", "true", ""), (" confidence", 0.98, 0.2)],
)
def test_frames_that_are_not_valid_are_not_seen(
    stimuli, make_known, tmp_path: Path, name: str, good: object, bad: object
) -> None:
    spoilt(make_known, name, good, bad).to_csv(tmp_path / "s.csv", index=False)
    files = ("--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    ended = stimuli("blinks", tmp_path / "s.csv", "--column", "gap_l", "--fps", FPS, *files)
    assert ended.code == 0, ended.err
    assert "s.csv: 120 of 1,200 frames" in ended.err
    assert "treated as missing" in ended.err
    assert "treated as missing" in (tmp_path / "r.html").read_text(encoding="utf-8")
    events = pd.read_csv(tmp_path / "b.events.csv")
    assert events["kind"].to_list() == ["blink"] * 4


def test_frames_not_valid_stay_unseen_when_times_are_evened(make_known, tmp_path: Path) -> None:
    table = spoilt(make_known, "success", 1, 0)
    table["time_s"] = np.arange(len(table)) / FPS + np.random.default_rng(2).uniform(0, 0.002, len(table))
    table.to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["gap_l"], resample=True)
    assert series.missing_frames == pytest.approx(121, abs=1)
    assert np.isnan(series.distance[305:415]).all()


@pytest.mark.parametrize(
    ("name", "good", "bad", "message"),
    [
        ("valid", "yes", "no", "with 1 or 0 .* got 'yes'"),
        ("success", 0, 0, "no frames are left: remove the column"),
        ("confidence", 98, 12, "between 0 and 1, got 12 to 98"),
    ],
)
def test_a_column_of_something_else_is_refused(
    make_known, tmp_path: Path, name: str, good: object, bad: object, message: str
) -> None:
    spoilt(make_known, name, good, bad).to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match=message):
        read_series(tmp_path / "s.csv", ["gap_l"], FPS)


def test_doubtful_frames_of_a_track_are_said(stimuli, make_known, tmp_path: Path) -> None:
    known = make_known(noise=0.05)
    status = np.where(np.arange(known.distance.size) < 50, "doubtful", "tracked")
    times = np.arange(known.distance.size) / known.fps
    track = pd.DataFrame({"time_s": times, "distance_px": known.distance, "status": status})
    track.to_csv(tmp_path / "t.csv", index=False)
    ended = stimuli(
        "blinks", tmp_path / "t.csv", "--out", tmp_path / "b.csv", "--report", tmp_path / "r.html"
    )
    assert ended.code == 0, ended.err
    assert "t.csv: 50 of 3,000 frames are doubtful" in ended.err
    assert (tmp_path / "r.html").read_text(encoding="utf-8").count("frames are doubtful") == 1


def test_a_confidence_in_words_is_refused(tmp_path: Path) -> None:
    table = pd.DataFrame({"gap": np.full(400, 20.0), "confidence": ["97%"] * 400})
    table.to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match="'confidence' must have numbers between 0 and 1, got '97%'"):
        read_series(tmp_path / "s.csv", ["gap"], 240)


@pytest.mark.parametrize("name", ["EAR2D6_valid", "face_valid", "isValid", "detection_success"])
def test_a_validity_of_a_longer_name_is_heeded(make_known, tmp_path: Path, name: str) -> None:
    table = spoilt(make_known, name, 1, 0).rename(columns={" gap_l": "EAR2D6_l"})
    table.assign(face_x=1.5).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["EAR2D6_l"], FPS)
    assert series.notes == (f"s.csv: 120 of 1,200 frames are not valid by '{name}': treated as missing",)
    assert series.missing_frames == 120


@pytest.mark.parametrize("name", ["left_valid", "valid_l", "gap_valid_left"])
def test_a_validity_of_one_eye_holds_for_it_alone(make_known, tmp_path: Path, name: str) -> None:
    table = spoilt(make_known, name, 1.0, 0.0)
    table.insert(0, "gap_r", table[" gap_l"] + 0.5)
    table.to_csv(tmp_path / "s.csv", index=False)
    left, right = read_series(tmp_path / "s.csv", ["gap_l", "gap_r"], FPS)
    assert (left.missing_frames, right.missing_frames) == (120, 0)
    assert f"120 of 1,200 frames of gap_l are not valid by '{name}'" in left.notes[0]


def test_a_validity_of_other_columns_is_not_heeded(make_known, tmp_path: Path) -> None:
    table = spoilt(make_known, "BS_Valid", 1, 0).assign(BS_blink=0.5)
    table.to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["gap_l"], FPS)
    assert (series.missing_frames, series.notes) == (0, ())


@pytest.mark.parametrize("name", ["valid_points", "points_valid", "invalid"])
def test_a_number_of_valid_points_is_not_validity(make_known, tmp_path: Path, name: str) -> None:
    spoilt(make_known, name, 68, 0).to_csv(tmp_path / "s.csv", index=False)
    assert read_series(tmp_path / "s.csv", ["gap_l"], FPS)[0].missing_frames == 0


@pytest.mark.parametrize(
    "name",
    [
        *("valid_blink", "BS_blink_valid", "trial_success", "task_success", "gap_response_valid"),
        *("not_valid", "gap_not_valid", "last_valid", "success_note", "g_valid", "BS_Valid", "gaze_valid"),
    ],
)
def test_a_validity_of_something_else_is_not_heeded(make_known, tmp_path: Path, name: str) -> None:
    table = spoilt(make_known, name, 1, 0).rename(columns={" gap_l": "gap_l"})
    table.to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["gap_l"], FPS)
    assert (series.missing_frames, [note for note in series.notes if name in note]) == (0, [])


def test_a_validity_is_of_the_columns_whose_names_begin_as_it_does(make_known, tmp_path: Path) -> None:
    table = spoilt(make_known, "eyeGap_valid", 1, 0).rename(columns={" gap_l": "eyeGapLeft"})
    table.assign(lid_r=table["eyeGapLeft"] + 1).to_csv(tmp_path / "s.csv", index=False)
    eyes = read_series(tmp_path / "s.csv", ["eyeGapLeft", "lid_r"], FPS)
    assert [eye.missing_frames for eye in eyes] == [120, 0]


@pytest.mark.parametrize(("good", "bad", "missing"), [("", 0, 120), (1, "", 0)])
def test_a_blank_says_nothing_in_a_validity_of_a_longer_name(
    make_known, tmp_path: Path, good: object, bad: object, missing: int
) -> None:
    spoilt(make_known, "gap_valid", good, bad).to_csv(tmp_path / "s.csv", index=False)
    assert read_series(tmp_path / "s.csv", ["gap_l"], FPS)[0].missing_frames == missing
