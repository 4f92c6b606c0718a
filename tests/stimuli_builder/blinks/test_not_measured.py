"""Values that a tracker repeats, or zeros that it writes where it sees no face, do not measure lids."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import BlinkSeries, read_series

DEPTHS = (1.0, 0.6, 0.95, 1.0)


def read(path: Path, values: Array, fps: float, name: str = "gap_l") -> BlinkSeries:
    pd.DataFrame({name: values}).to_csv(path / "s.csv", index=False)
    return read_series(path / "s.csv", [name], fps)[0]


@pytest.mark.parametrize("fps", [15.0, 30.0, 120.0, 300.0])
def test_a_value_that_is_repeated_for_seconds_is_reported_and_not_seen(
    make_known, tmp_path: Path, fps: float
) -> None:
    distance = make_known(fps=fps, noise=0.3).distance.copy()
    frozen = slice(round(2.6 * fps), round(4.8 * fps))  # over the second blink
    distance[frozen] = distance[frozen.start]
    series = read(tmp_path, distance, fps)
    (note,) = series.notes
    assert "s.csv: 'gap_l' (left eye) repeats one value for at least one second: once, 2.2 s" in note
    assert "first at 2.6" in note
    assert series.missing_frames == pytest.approx(2.2 * fps, abs=1)
    assert np.isnan(series.distance[frozen.start + 1 : frozen.stop]).all()


def test_seconds_frozen_are_not_a_time_of_the_rate(stimuli, make_known, tmp_path: Path) -> None:
    known = make_known(fps=120.0, noise=0.3)
    left, right = known.distance.copy(), known.distance * 0.9
    left[300:400], left[840:1000] = left[300], left[840]
    pd.DataFrame({"gap_l": left, "gap_r": right}).to_csv(tmp_path / "s.csv", index=False)
    ended = stimuli(
        "blinks", tmp_path / "s.csv", "--column", "gap_l", "--column", "gap_r", "--fps", 120,
        "--out", tmp_path / "b.csv", "--summary", tmp_path / "s.json",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    assert ended.err.count("repeats one value") == 1
    minutes = [one["minutes"] for one in json.loads((tmp_path / "s.json").read_text("utf-8"))["columns"]]
    assert minutes == pytest.approx([(1200 - 159) / 7200, 1200 / 7200], abs=1e-3)


@pytest.mark.parametrize("digits", [None, 2, 0])
def test_a_series_without_noise_repeats_nothing(make_known, tmp_path: Path, digits: int | None) -> None:
    distance = make_known(fps=60.0).distance
    series = read(tmp_path, distance if digits is None else np.round(distance, digits) + 0.0, 60.0)
    assert series.notes == ()
    assert series.missing_frames == 0


def test_a_coarse_series_repeats_nothing(make_known, tmp_path: Path) -> None:
    distance = np.round(make_known(fps=60.0, noise=0.1).distance / 34, 2)
    series = read(tmp_path, distance, 60.0)
    assert series.notes == ()
    assert series.missing_frames == 0


@pytest.mark.parametrize("name", ["gap_l", "l_closure"])
def test_lids_that_meet_for_seconds_are_not_repeated(make_known, tmp_path: Path, name: str) -> None:
    distance = make_known(fps=60.0, noise=0.3).distance / 40
    distance[300:420] *= 0.0
    distance[290:300] *= np.linspace(1, 0, 10)
    distance[420:440] *= np.linspace(0, 1, 20)
    series = read(tmp_path, distance if name == "gap_l" else 1 - distance, 60.0, name)
    assert series.missing_frames == 0


def test_a_closure_cut_at_its_open_end_is_not_repeated(make_known, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rest = np.maximum(rng.normal(-0.1, 0.1, 1200), 0)
    rest[300:420] = 0.0
    shut = 1 - make_known(fps=120.0).distance / 34
    assert read(tmp_path, np.maximum(rest, shut), 120.0, "AU45_r").missing_frames == 0


def test_zeros_of_a_lost_face_are_reported_and_no_blink(stimuli, make_known, tmp_path: Path) -> None:
    known = make_known(fps=60.0, noise=0.3, depths=(0.6, 0.5, 0.7, 0.6))
    distance = known.distance.copy()
    for start, length in ((200, 9), (300, 12), (400, 1)):
        distance[start : start + length] = 0.0
    pd.DataFrame({"gap_l": distance}).to_csv(tmp_path / "s.csv", index=False)
    ended = stimuli(
        "blinks", tmp_path / "s.csv", "--column", "gap_l", "--fps", 60, "--out", tmp_path / "b.csv"
    )
    assert ended.code == 0, ended.err
    assert "s.csv: 'gap_l' (left eye) jumps to 0 and back from one frame to the next: 3 times, 0.367 s" in (
        ended.err
    )
    assert "first at 3.333 s" in ended.err
    minima = pd.read_csv(tmp_path / "b.csv")["minimum_s"]
    assert minima.to_list() == pytest.approx([2, 4, 6, 8], abs=0.05)


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
def test_lids_that_meet_at_0_are_kept(make_known, tmp_path: Path, fps: float) -> None:
    distance = np.maximum(make_known(fps=fps, noise=0.1, depths=(1.1, 1.2, 1.3)).distance, 0)
    assert (distance == 0).any()
    series = read(tmp_path, distance, fps)
    assert series.notes == ()
    assert (series.distance == 0).any()


def test_zeros_at_both_ends_are_not_seen(make_known, tmp_path: Path) -> None:
    distance = make_known(fps=60.0, noise=0.3, depths=(0.6, 0.5)).distance.copy()
    distance[:30] = distance[-10:] = 0.0
    series = read(tmp_path, distance, 60.0)
    assert "2 times" in series.notes[0]
    assert series.missing_frames == 40


def test_zeros_next_to_frames_without_a_value_are_not_seen(make_known, tmp_path: Path) -> None:
    distance = make_known(fps=60.0, noise=0.3, depths=(0.6, 0.5)).distance.copy()
    distance[170:175], distance[175:190] = np.nan, 0.0
    distance[300:310], distance[310] = 0.0, np.nan
    pd.DataFrame({"gap_l": distance}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", fps=60.0, allow_gaps=True)
    assert "2 times, 0.417 s" in series.notes[0]
    assert np.isnan(series.distance[170:190]).all()
    assert np.isnan(series.distance[300:311]).all()


@pytest.mark.parametrize("fps", [15.0, 20.0])
def test_lids_may_shut_within_a_frame_of_a_slow_camera(make_known, tmp_path: Path, fps: float) -> None:
    # Another eye that never quite meets: zeros are the clipped minima of some blinks alone.
    distance = make_known(fps=fps, noise=0.3, depths=(0.5, 0.6, 0.0, 0.0)).distance.copy()
    for number in (3, 4):
        distance[round(2 * number * fps)] = 0.0
    series = read(tmp_path, distance, fps)
    assert (series.notes, series.missing_frames) == ((), 0)


def test_zeros_that_may_be_the_only_closures_are_left(make_known, tmp_path: Path) -> None:
    closed = make_known(fps=60.0).distance < 17
    opening = np.where(closed, 0.0, np.random.default_rng(3).normal(0.9, 0.01, closed.size))
    opening[np.flatnonzero(closed)[0]] = 0.4  # one lid was caught on its way
    series = read(tmp_path, opening, 60.0, "openness_l")
    (note,) = series.notes
    assert "s.csv: 'openness_l' (left eye) jumps to 0 and back from one frame to the next: 3 times" in note
    assert "kept: nothing else closes in this column" in note
    assert series.missing_frames == 0
    assert (series.distance == 0).sum() == closed.sum() - 1


def test_zeros_next_to_a_partial_blink_are_not_the_only_closures(make_known, tmp_path: Path) -> None:
    distance = make_known(fps=60.0, noise=0.3, depths=(0.0, 0.5, 0.0)).distance.copy()
    distance[100:112] = distance[340:352] = 0.0
    series = read(tmp_path, distance, 60.0)
    assert "2 times" in series.notes[0]
    assert series.missing_frames == 24
