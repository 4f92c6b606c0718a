"""Holes in time stamps are not seen: no straight line crosses them, no minute counts them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.errors import InputError
from stimuli_builder.blinks.export import timecode
from stimuli_builder.blinks.profile import Array
from stimuli_builder.blinks.series import read_series


def written(path: Path, times: Array, values: Array) -> Path:
    pd.DataFrame({"time_s": times, "gap": values}).to_csv(path, index=False)
    return path


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
def test_a_pause_in_the_times_is_not_a_recording(stimuli, make_known, tmp_path: Path, fps: float) -> None:
    known = make_known(fps=fps, noise=0.05)
    times = np.arange(known.distance.size) / fps
    times[known.minima[1] + round(fps) :] += 60  # between two blinks
    path = written(tmp_path / "s.csv", times, known.distance)
    ended = stimuli(
        "blinks", path, "--resample", "--out", tmp_path / "b.csv", "--summary", tmp_path / "s.json"
    )
    assert ended.code == 0, ended.err
    assert "s.csv: 1 hole in time_s" in ended.err
    assert "60 s in total" in ended.err
    (column,) = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))["columns"]
    assert column["blinks"] == 4
    assert column["fps"] == pytest.approx(fps, rel=0.001)
    assert column["minutes"] == pytest.approx(known.distance.size / fps / 60, rel=0.01)


def test_a_hole_of_half_a_second_costs_the_blink_in_it_alone(stimuli, make_known, tmp_path: Path) -> None:
    known = make_known(fps=120.0, noise=0.05)
    times = np.arange(known.distance.size) / 120
    seen = (times < 5.8) | (times > 6.3)  # the third blink is at 6 s
    path = written(tmp_path / "s.csv", times[seen], known.distance[seen])
    assert stimuli("blinks", path, "--resample", "--out", tmp_path / "b.csv").code == 0
    minima = pd.read_csv(tmp_path / "b.csv")["minimum_s"]
    assert minima.to_list() == pytest.approx([2, 4, 8], abs=0.03)


@pytest.mark.parametrize(
    ("fps", "dropped", "holes"), [(30.0, 1, 0), (30.0, 2, 1), (240.0, 6, 0), (240.0, 9, 1)]
)
def test_a_few_dropped_frames_are_bridged(tmp_path: Path, fps: float, dropped: int, holes: int) -> None:
    times = np.delete(np.arange(round(4 * fps)) / fps, np.s_[100 : 100 + dropped])
    path = written(tmp_path / "s.csv", times, np.linspace(20, 30, times.size))
    (series,) = read_series(path, resample=True)
    assert series.distance.size == pytest.approx(4 * fps, abs=dropped)  # at the mean rate
    assert series.missing_frames == pytest.approx(holes * dropped, abs=1)
    assert len(series.notes) == holes


def test_an_empty_value_is_still_refused_next_to_a_hole(tmp_path: Path) -> None:
    times = np.arange(400) / 60
    times[200:] += 5
    values = np.full(400, 20.0)
    values[50:100] = np.nan
    path = written(tmp_path / "s.csv", times, values)
    with pytest.raises(InputError, match=r"has no value for 5[01] frames"):
        read_series(path, resample=True)


def test_times_that_jump_by_years_are_refused(tmp_path: Path) -> None:
    times = np.arange(400) / 60
    times[200:] += 1.7e9
    with pytest.raises(InputError, match=r"are allowed\. Cut the recording at the pause"):
        read_series(written(tmp_path / "s.csv", times, np.full(400, 20.0)), resample=True)


def test_a_rate_too_low_is_reported_in_few_digits(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"at 0\.03 frames per second blinks cannot"):
        read_series(written(tmp_path / "s.csv", np.arange(400) / 0.03, np.full(400, 20.0)))


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [
        ("timestamp", 1.0, "s"),
        (" timestamp", 1.0, "s"),
        ("timestamp", 1000.0, "ms"),
        ("time_ms", 1000.0, "ms"),
        ("timestamp_ms", 1000.0, "ms"),
        ("Time (s)", 1.0, "s"),
        ("time", 1000.0, "ms"),
    ],
)
def test_usual_names_of_times_are_read(tmp_path: Path, name: str, factor: float, unit: str) -> None:
    times = np.arange(400) / 240 * factor
    pd.DataFrame({name: times, "gap": np.full(400, 20.0)}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv")
    assert series.fps == pytest.approx(240)
    assert series.notes == (f"s.csv: times are from '{name.strip()}', in {unit}",)


@pytest.mark.parametrize(("part", "unit"), [(1e6, "µs"), (1e9, "ns")])
def test_times_of_cameras_are_read(tmp_path: Path, part: float, unit: str) -> None:
    times = np.round(np.arange(400) / 240 * part)
    pd.DataFrame({"timestamp": times, "gap": np.full(400, 20.0)}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["gap"])
    assert series.fps == pytest.approx(240)
    assert series.notes == (f"s.csv: times are from 'timestamp', in {unit}",)


@pytest.mark.parametrize(("fps", "even"), [(120, True), (240, True), (300, True), (500, True)])
def test_times_that_are_rounded_to_a_millisecond_are_even(tmp_path: Path, fps: float, even: bool) -> None:
    times = np.round(np.arange(600) / fps, 3)
    path = written(tmp_path / "s.csv", times, np.full(600, 20.0))
    assert read_series(path)[0].fps == pytest.approx(fps, rel=0.002)
    path = written(tmp_path / "s.csv", np.delete(times, [300, 301]), np.full(598, 20.0))
    with pytest.raises(InputError, match="uneven"):
        read_series(path)


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        (list(range(400)), "'timestamp' counts frames; expected times: add the recording's rate with --fps"),
        ([f"2026-11-28T10:00:{n % 60:02d}" for n in range(400)], "'timestamp' is not a number in every row"),
    ],
)
def test_a_rate_that_was_given_needs_no_column_of_times(tmp_path: Path, stamps, expected: str) -> None:
    pd.DataFrame({"timestamp": stamps, "gap": np.full(400, 20.0)}).to_csv(tmp_path / "s.csv", index=False)
    assert read_series(tmp_path / "s.csv", ["gap"], 240)[0].fps == 240
    with pytest.raises(InputError, match=expected):
        read_series(tmp_path / "s.csv", ["gap"])


def test_a_gap_of_a_resampled_series_is_reported_by_its_time(tmp_path: Path) -> None:
    values = np.full(400, 20.0)
    values[120:180] = np.nan
    with pytest.raises(InputError, match=r"from 1\.98\d s on|from 2\.00\d s on"):
        read_series(written(tmp_path / "s.csv", np.arange(400) / 60, values), resample=True)


@pytest.mark.parametrize(
    ("name", "stamps"),
    [
        ("timestamp", np.arange(400) / 120),
        ("timestamp [ns]", 1_760_676_790_465_965_534 + np.arange(400) * 8_333_333),
        ("time_ms", np.arange(400) * 1000 / 120),
        ("Timecode", [f"10:00:{n // 120:02d}:{n % 120:02d}.000" for n in range(400)]),
        ("time_s", np.arange(400) / 120),
    ],
)
def test_a_rate_that_contradicts_any_time_stamps_is_refused(tmp_path: Path, name: str, stamps) -> None:
    values = np.linspace(20, 21, 400)
    pd.DataFrame({name: stamps, "gap": values}).to_csv(tmp_path / "s.csv", index=False)
    with pytest.raises(InputError, match=r"--fps 240 contradicts s.csv, whose .* runs at 120"):
        read_series(tmp_path / "s.csv", ["gap"], 240)
    assert read_series(tmp_path / "s.csv", ["gap"], 120)[0].fps == pytest.approx(120, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "factor", "unit"),
    [("timestamp [ns]", 1e9, "ns"), ("Timestamp (us)", 1e6, "µs"), ("timestamp[ms]", 1e3, "ms")],
)
def test_the_unit_that_a_name_of_times_states_holds(
    tmp_path: Path, name: str, factor: float, unit: str
) -> None:
    stamps = (1.76e9 * factor + np.arange(400) / 200 * factor).astype(np.int64)
    pd.DataFrame({name: stamps, "gap": np.linspace(20, 21, 400)}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv")
    assert series.fps == pytest.approx(200, rel=1e-4)
    assert series.notes[0] == f"s.csv: times are from '{name}', in {unit}"


@pytest.mark.parametrize(("fps", "base"), [(30, 60), (60, 60), (30, 30), (24, 24), (120, 120)])
def test_a_time_code_is_read_in_the_base_in_which_it_counts(tmp_path: Path, fps: int, base: int) -> None:
    step = base // fps
    stamps = [f"23:59:{n // fps:02d}:{n % fps * step:02d}.250" for n in range(fps * 4)]
    pd.DataFrame({"Timecode": stamps, "eyeBlinkLeft": np.linspace(0, 0.5, fps * 4)}).to_csv(
        tmp_path / "s.csv", index=False
    )
    (series,) = read_series(tmp_path / "s.csv", ["eyeBlinkLeft"])
    assert series.fps == pytest.approx(fps, rel=1e-3)


@pytest.mark.parametrize("fps", [24.0, 29.97, 30.0, 59.94, 60.0])
def test_time_codes_of_our_own_export_are_read(tmp_path: Path, fps: float) -> None:
    stamps = [timecode(n, fps) for n in range(round(6 * fps))]
    values = np.linspace(0, 0.5, len(stamps))
    pd.DataFrame({"Timecode": stamps, "eyeBlinkLeft": values}).to_csv(tmp_path / "s.csv", index=False)
    (series,) = read_series(tmp_path / "s.csv", ["eyeBlinkLeft"])
    assert series.fps == pytest.approx(fps, rel=2e-3)
    assert series.distance.size == pytest.approx(len(stamps), abs=1)


def test_a_table_of_one_row_is_refused_as_one(stimuli, tmp_path):
    (tmp_path / "one.csv").write_text("time,left\n0,1\n")
    ended = stimuli("blinks", tmp_path / "one.csv", "--out", tmp_path / "out.csv")
    assert ended.code == 2
    assert "expected two frames or more, got a table of one row" in " ".join(ended.err.split())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda times: times.__setitem__(30, times[29]), "line 32 repeats the time of the row before"),
        (lambda times: times.__setitem__(slice(60, None), times[60:] - 0.5), "line 62 goes back in time"),
        (
            lambda times: times.__setitem__(slice(None), 1.76e9 + np.r_[times[:60], times[60:] - 0.5]),
            r"line 62 goes back in time \(1760000000.983333, then 1760000000.5 s\)",
        ),
        (
            lambda times: times.__setitem__(40, np.nan),
            "line 42 has no time_s; add the time",
        ),
        (lambda times: times.__imul__(1000), r"If the times are in ms, name the column time_ms \(60 frames"),
    ],
)
def test_times_that_cannot_be_are_refused_with_their_line(tmp_path: Path, change, said: str) -> None:
    times = np.arange(120) / 60
    change(times)
    with pytest.raises(InputError, match=said):
        read_series(written(tmp_path / "s.csv", times, np.linspace(20, 30, 120)))


@pytest.mark.parametrize(
    ("fps", "low", "high"),
    [(24, -0.37, -0.25), (30, -0.27, -0.15), (60000 / 1001, -0.16, -0.06), (240, -0.08, 0.0)],
)
def test_few_frames_flatten_the_peak_velocity_and_the_screen_says_so(
    stimuli, tmp_path: Path, fps: float, low: float, high: float
) -> None:
    # By hand: a half cosine of amplitude A in T seconds is fastest in its middle, A pi / (2 T).
    times, random = np.arange(round(30 * fps)) / fps, np.random.default_rng(1)
    since = (times - 1.013) % 2.57
    closing = np.where(since < 0.1, 12.5 * (1 - np.cos(np.pi * since / 0.1)), 25.0)
    opening = np.where(since < 0.38, 12.5 * (1 + np.cos(np.pi * (since - 0.13) / 0.25)), 0.0)
    values = 30 - np.where(since < 0.13, closing, opening) + random.normal(0, 0.2, times.size)
    path = written(tmp_path / "s.csv", times, values)
    ended = stimuli("blinks", path, "--out", tmp_path / "b.csv", "--report", tmp_path / "r.html")
    assert ended.code == 0, ended.err
    velocity = pd.read_csv(tmp_path / "b.csv")["peak_closing_velocity"].median()
    assert low < velocity / (25 * np.pi / 2 / 0.1) - 1 < high
    for said in (ended.err, (tmp_path / "r.html").read_text(encoding="utf-8")):
        assert ("peak closing velocities are too low" in said) == (fps < 59)
