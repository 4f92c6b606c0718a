from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.blinks.series import box_filter, read_series, scaled_frames
from stimuli_builder.blinks.times import bridge_gaps, runs


@settings(deadline=None, max_examples=40)
@given(st.floats(0.3, 40), st.integers(1, 90), st.floats(-5, 5))
def test_the_filter_keeps_a_constant(width, length, level):
    assert box_filter(np.full(length, level), width) == pytest.approx(np.full(length, level))


@settings(deadline=None, max_examples=40)
@given(st.floats(1, 30), st.integers(0, 2**32 - 1))
def test_the_filter_has_zero_phase(width, seed):
    values = np.random.default_rng(seed).normal(size=60)
    assert box_filter(values[::-1], width) == pytest.approx(box_filter(values, width)[::-1])


def test_a_whole_odd_width_is_a_plain_moving_average():
    values = np.random.default_rng(3).normal(size=50)
    assert box_filter(values, 5)[10] == pytest.approx(values[8:13].mean())


def test_an_even_width_takes_half_of_both_ends():
    values = np.random.default_rng(3).normal(size=50)
    expected = (values[5:16].sum() - (values[5] + values[15]) / 2) / 10
    assert box_filter(values, 10)[10] == pytest.approx(expected)


def test_ten_frames_of_the_paper_are_eight_at_240_fps():
    assert scaled_frames(10, 240) == 8


def test_short_gaps_are_bridged_and_long_ones_stay():
    values = np.array([1, np.nan, 3, np.nan, np.nan, np.nan, 7, 8])
    filled, bridged = bridge_gaps(values, 2)
    assert bridged == 1
    assert filled[1] == 2
    assert np.isnan(filled[3:6]).all()


def test_runs_give_start_and_stop():
    assert runs(np.array([True, False, True, True])) == [(0, 1), (2, 4)]


def _write(path, header, columns):
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def test_the_rate_of_a_track_comes_from_its_times(tmp_path):
    times = np.arange(400) / 250
    path = _write(tmp_path / "t.csv", "frame,time_s,distance_px", [range(400), times, [10.0] * 400])
    (series,) = read_series(path)
    assert series.fps == pytest.approx(250)
    assert series.is_px


def test_a_track_keeps_the_frames_that_were_not_fitted(tmp_path):
    distance = ["30.5"] * 150 + [""] * 100 + ["30.5"] * 150
    status = ["ok"] * 150 + ["lost"] * 100 + ["ok"] * 150
    columns = [range(400), np.arange(400) / 100, distance, status]
    (series,) = read_series(_write(tmp_path / "t.csv", "frame,time_s,distance_px,status", columns))
    assert series.missing_frames == 100


def test_blanks_in_a_series_are_read(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("frame, EAR\n" + "".join(f"{k}, 0.3\n" for k in range(300)), encoding="utf-8")
    (series,) = read_series(path, ["EAR"], 240)
    assert series.distance[0] == 0.3


GOOD = [0.3] * 400


@pytest.mark.parametrize(
    ("header", "columns", "wanted", "fps", "message"),
    [
        ("frame,EAR_l", [range(400), GOOD], ["EAR_x"], 240, r"no column 'EAR_x'; did you mean 'EAR_l'\?"),
        ("frame,a,b", [range(400), GOOD, GOOD], [], 240, "select the series with --column"),
        ("frame,a", [range(400), ["x"] * 400], ["a"], 240, "must have numbers"),
        (
            "frame,a",
            [range(400), [*GOOD[:6], "abc", *GOOD[7:]]],
            ["a"],
            240,
            "must have numbers, got 'abc' in line 8",
        ),
        ("frame,a", [range(400), GOOD], ["a"], None, "with the recording's rate"),
        ("frame,a", [range(400), GOOD], ["a"], -5, "between 10 and 10000"),
        ("frame,a", [range(400), GOOD], ["a"], float("nan"), "between 10 and 10000"),
        ("frame,a", [range(20), GOOD[:20]], ["a"], 240, "less than one second"),
        ("frame,a", [range(400), [""] * 400], ["a"], 240, "is empty"),
        (
            "frame,a",
            [range(400), [0.3] * 99 + [""] * 60 + [0.3] * 241],
            ["a"],
            240,
            "no value for 60 frames from line 101",
        ),
        ("frame,a", [range(400), [0.3] * 399 + [-2.0]], ["a"], 240, "negative"),
        ("time_s,a", [np.arange(400) / 240, GOOD], ["a"], 100, "contradicts"),
        ("time_s,a", [[*np.arange(399) / 240, 9.0], GOOD], ["a"], None, r"uneven \(line 401\)"),
        ("time_s,a", [[*np.arange(399) / 240, 0.0], GOOD], ["a"], None, "increase"),
    ],
)
def test_a_series_that_cannot_be_used_is_refused_in_one_line(tmp_path, header, columns, wanted, fps, message):
    path = _write(tmp_path / "series.csv", header, columns)
    with pytest.raises(InputError, match=message) as refused:
        read_series(path, wanted, fps)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", ["", "\x00\x01", "a,b\n"])
def test_a_file_that_is_not_a_table_is_refused(tmp_path, content):
    path = tmp_path / "bad.csv"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.csv"):
        read_series(path, ["a"], 240)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no file .*none\.csv; expected a table"):
        read_series(tmp_path / "none.csv", [], 240)


def test_a_column_that_is_named_twice_is_read_once(tmp_path: Path) -> None:
    path = _write(tmp_path / "series.csv", "time_s,a", [np.arange(400) / 240, GOOD])
    assert [series.column for series in read_series(path, ["a", "a"])] == ["a"]


def test_a_word_in_a_series_that_is_to_be_resampled_is_named(tmp_path: Path) -> None:
    values = [*GOOD[:6], "lost", *GOOD[7:]]
    path = _write(tmp_path / "series.csv", "time_s,a", [np.arange(400) / 240, values])
    with pytest.raises(InputError, match=r"must have numbers, got 'lost' in line 8"):
        read_series(path, ["a"], resample=True)


def test_left_and_right_of_a_track_are_said_to_be_the_pictures(tmp_path):
    times = np.arange(600) / 60
    table = {"time_s": times, "left_distance_px": 20 + np.sin(times), "right_distance_px": 20 + np.cos(times)}
    pd.DataFrame(table).to_csv(tmp_path / "t.csv", index=False)
    assert all("sides of the picture" in " ".join(eye.notes) for eye in read_series(tmp_path / "t.csv"))
    pd.DataFrame({"time_s": times, "EAR_l": table["left_distance_px"]}).to_csv(
        tmp_path / "s.csv", index=False
    )
    assert "sides of the picture" not in " ".join(read_series(tmp_path / "s.csv")[0].notes)
