"""Blinks, squints, gaze shifts and closed eyes kept apart, at any rate, on series that trained nothing."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from bench.lid_event_training import Motion, course, generate, true_kinds
from stimuli_builder.blinks.events.candidates import COURSE, courses, depth_of, find_candidates
from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.labelling import DEFAULT_OPTIONS
from stimuli_builder.blinks.series import BlinkSeries, read_series
from stimuli_builder.blinks.tables import EVENT_COLUMNS

HELD_OUT = 77
"""First part of the seed of held-out series; training begins its seeds with another number."""


def eye(distance, fps):
    return BlinkSeries(distance=np.asarray(distance, float), fps=fps, column="d_l", is_px=True)


def kinds_of(distance, fps):
    (seen,) = recognise([eye(distance, fps)])
    return [event.kind for event in seen.events]


def lids(motions, fps, seconds=20.0, noise=0.006):
    """Distance in px with the given events."""
    times = np.arange(round(seconds * fps)) / fps
    rng = np.random.default_rng(5)
    open_share = np.ones(times.size)
    for motion in motions:
        open_share *= 1 - np.clip(course(motion, times, rng), 0, 1)
    return 30 * np.maximum(open_share + rng.normal(0, noise, times.size), 0)


def blinks_at(*onsets, hold=0.03):
    return [Motion("blink", onset, 0.1, hold, 0.25, 1.0) for onset in onsets]


@pytest.mark.parametrize("fps", [15.0, 30.0, 120.0, 500.0])
def test_blinks_of_held_out_series_are_told_from_the_rest(fps):
    hits = alarms = missed = squints = squint_alarms = 0
    for number in range(8):
        series = generate(np.random.default_rng([HELD_OUT, number]), 40, fps)
        seen = recognise([eye(distance, fps) for distance in series.distances])[0]
        found = [event.minimum_s for event in seen.events if event.kind == "blink"]
        true = [m for m in series.motions if m.kind == "blink"]
        inside = [sum(m.onset_s - 0.05 <= time <= m.end_s + 0.05 for time in found) for m in true]
        hits += sum(count > 0 for count in inside)
        missed += inside.count(0)
        alarms += len(found) - sum(count > 0 for count in inside)  # a blink told twice is told once too often
        flat = [m for m in series.motions if m.kind in ("squint", "closed_eye") and m.hold_s >= 0.25]
        squints += len(flat)
        squint_alarms += sum(any(m.onset_s <= time <= m.end_s for time in found) for m in flat)
    assert 2 * hits / (2 * hits + alarms + missed) > 0.8, (hits, alarms, missed)
    assert squint_alarms <= 0.05 * squints


def reopening_in_steps(fps, rng):
    """Full blinks whose lids stop, and even sink a little, for a frame or two as they open again."""
    distance = lids(blinks_at(2, 5, 9, 13, 16), fps, noise=0.01)
    for onset in (2, 5, 9, 13, 16):
        start = round((onset + 0.1 + 0.03 + rng.uniform(0.12, 0.24)) * fps)
        distance[start : start + max(1, round(0.03 * fps))] -= 30 * rng.uniform(0.12, 0.2)
    return distance


@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_a_step_in_the_reopening_is_not_a_second_blink(fps):
    told = [
        kinds_of(reopening_in_steps(fps, np.random.default_rng(seed)), fps).count("blink")
        for seed in range(8)
    ]
    assert told == [5] * 8


def test_one_dip_of_a_blink_is_taught_as_the_blink_and_its_ripples_as_nothing():
    motions = tuple(blinks_at(2, 5, 9, 13, 16))
    distance = reopening_in_steps(60.0, np.random.default_rng(1))
    depth = depth_of(distance, 60.0)
    candidates = find_candidates(depth)
    about = [
        kind
        for candidate, kind in zip(candidates, true_kinds(candidates, depth, motions), strict=True)
        if any(m.onset_s <= candidate.peak / 60 <= m.end_s for m in motions)
    ]
    assert about.count("blink") == 5
    assert about.count("nothing") == len(about) - 5 > 0


def test_the_course_about_a_dip_is_the_same_at_every_rate():
    means = {}
    for fps in (15.0, 60.0, 300.0):
        times = np.arange(round(6 * fps)) / fps
        values = np.exp(-(((times - 3) / 0.4) ** 2))
        means[fps] = courses(values, np.array([round(3 * fps)]), fps)[0]
    assert means[15.0] == pytest.approx(means[300.0], abs=0.01)
    assert means[60.0] == pytest.approx(means[300.0], abs=0.001)


def test_a_course_beyond_the_series_keeps_its_last_value():
    values = np.array([0.5, 0.5, 1.0, 0.0, 0.0])
    means = courses(values, np.array([2]), 10.0)[0]
    assert means[0] == pytest.approx(0.5)
    assert means[-1] == pytest.approx(0.0)
    assert len(means) == len(COURSE)


@pytest.mark.parametrize("fps", [15.0, 19.0, 23.976, 27.5, 30.0])
def test_every_correct_rate_is_taken(stimuli, tmp_path, fps):
    distance = lids(blinks_at(2, 5, 9, 13, 16), fps, seconds=20)
    path = tmp_path / "s.csv"
    pd.DataFrame({"time_s": np.arange(distance.size) / fps, "gap": distance}).to_csv(path, index=False)
    ended = stimuli("blinks", path, "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    assert "warning" not in ended.err
    assert len(pd.read_csv(tmp_path / "b.csv")) == 5


def test_squints_shut_lids_and_looking_down_are_not_blinks():
    others = [
        Motion("squint", 5, 0.4, 1.2, 0.6, 0.5),
        Motion("closed_eye", 9, 0.2, 2.0, 0.3, 1.0),
        Motion("gaze_shift", 14, 0.06, 1.5, 0.08, 0.4),
    ]
    for fps in (30.0, 240.0):
        kinds = kinds_of(lids([*blinks_at(2, 7.5, 12.5, 18), *others], fps), fps)
        assert kinds.count("blink") == 4, kinds
        assert "closed_eye" in kinds


@pytest.mark.parametrize(("hold", "kind"), [(0.05, "blink"), (0.3, "blink"), (1.2, "closed_eye")])
def test_half_a_second_closed_parts_a_blink_from_a_closed_eye(hold, kind):
    motion = Motion("blink", 8, 0.12, hold, 0.3, 1.0)
    assert kinds_of(lids([*blinks_at(3, 14), motion], 120.0), 120.0)[1] == kind


@pytest.mark.parametrize(("gaze", "depth"), [(0.3, 0.7), (0.4, 1.0), (0.6, 1.0)])
@pytest.mark.parametrize("fps", [120.0, 240.0])
def test_a_blink_while_looking_down_is_not_a_closed_eye(fps, gaze, depth):
    motions = [Motion("gaze_shift", 8, 0.08, 3.0, 0.1, gaze), Motion("blink", 8.8, 0.1, 0.04, 0.24, depth)]
    (seen,) = recognise([eye(lids([*blinks_at(3, 5.5, 14, 17), *motions], fps), fps)])
    assert "closed_eye" not in [event.kind for event in seen.events]
    (blink,) = [event for event in seen.events if event.kind == "blink" and 8 < event.minimum_s < 11]
    assert blink.minimum_s == pytest.approx(8.92, abs=0.03)
    assert 0.15 < blink.end_s - blink.onset_s < 0.5
    assert blink.closed_to_s - blink.closed_from_s < 0.3


@pytest.mark.parametrize(("gaze", "hold"), [(0.5, 0.55), (0.5, 0.6), (0.6, 0.55)])
def test_lids_shut_for_half_a_second_while_looking_down_are_a_closed_eye(gaze, hold):
    motions = [Motion("gaze_shift", 8, 0.08, 3.0, 0.1, gaze), Motion("blink", 8.6, 0.1, hold, 0.24, 1.0)]
    (seen,) = recognise([eye(lids([*blinks_at(3, 5.5, 14, 17), *motions], 120.0), 120.0)])
    assert {event.kind for event in seen.events if 8 < event.minimum_s < 11} == {"closed_eye"}


@pytest.mark.parametrize("fps", [30.0, 120.0])
@pytest.mark.parametrize(
    ("depth", "down", "hold", "up"),
    [(0.4, 0.14, 0.1, 0.4), (0.4, 0.18, 0.03, 0.35), (0.55, 0.22, 0.03, 0.35)],
)
def test_a_brief_slow_squint_is_not_a_blink(fps, depth, down, hold, up):
    squint = Motion("squint", 9, down, hold, up, depth)
    (seen,) = recognise([eye(lids([*blinks_at(3, 6, 14, 17), squint], fps), fps)])
    assert [event.kind for event in seen.events] == ["blink", "blink", "squint", "blink", "blink"]
    (told,) = [event for event in seen.events if event.kind == "squint"]
    assert 9 <= told.onset_s < told.minimum_s < told.end_s <= squint.end_s


@pytest.mark.parametrize("fps", [30.0, 120.0])
@pytest.mark.parametrize(("depth", "down", "hold", "up"), [(0.4, 0.14, 0.1, 0.4), (0.55, 0.22, 0.03, 0.35)])
def test_a_squint_that_looked_more_like_a_blink_has_the_squints_probability(fps, depth, down, hold, up):
    squint = Motion("squint", 9, down, hold, up, depth)
    (seen,) = recognise([eye(lids([*blinks_at(3, 6, 14, 17), squint], fps), fps)])
    (told,) = [event for event in seen.events if event.kind == "squint"]
    assert told.probability < 0.5


@pytest.mark.parametrize("fps", [30.0, 120.0])
@pytest.mark.parametrize("depth", [0.5, 0.7, 0.9])
def test_a_brisk_partial_blink_stays_a_blink(fps, depth):
    partial = Motion("blink", 9, 0.09, 0.02, 0.22, depth)
    assert kinds_of(lids([*blinks_at(3, 6, 14, 17), partial], fps), fps) == ["blink"] * 5


SHUT, LOWERED = {"blink", "closed_eye"}, {"squint", "gaze_shift"}


def assert_apart(events):
    """An eye shuts once at a time, and is lowered once at a time; each event holds its deepest moment."""
    assert [event.minimum_s for event in events] == sorted(event.minimum_s for event in events)
    for kinds in (SHUT, LOWERED):
        alike = [event for event in events if event.kind in kinds]
        for first, second in pairwise(alike):
            assert first.end_s <= second.onset_s, (first, second)
    for one in events:
        times = [one.onset_s, one.closed_from_s, one.minimum_s, one.closed_to_s, one.end_s]
        assert one.onset_s <= one.minimum_s <= one.end_s, one
        assert min(times) == one.onset_s, one
        assert max(times) == one.end_s, one


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 120.0])
def test_no_two_events_of_one_eye_overlap(fps):
    for number in range(4):
        series = generate(np.random.default_rng([HELD_OUT, 5, number]), 40, fps)
        for seen in recognise([eye(distance, fps) for distance in series.distances]):
            assert_apart(seen.events)


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_a_closed_eye_that_trembles_is_listed_once(fps):
    times = np.arange(round(20 * fps)) / fps
    shut = Motion("closed_eye", 9, 0.2, 3.0, 0.4, 0.9)
    tremble = 4 * np.sin(2 * np.pi * times / 0.9) * ((times > 9.3) & (times < 12.2))
    (seen,) = recognise([eye(np.maximum(lids([*blinks_at(2, 5, 15), shut], fps) + tremble, 0), fps)])
    assert [event.kind for event in seen.events if 8.5 < event.minimum_s < 13] == ["closed_eye"]


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0, 240.0, 600.0])
def test_phases_of_known_blinks_are_found_between_frames(fps):
    distance = lids(blinks_at(2.013, 5.027, 9.1, 13.004, 16.018, hold=0.06), fps)
    (seen,) = recognise([eye(distance, fps)])
    events = [event for event in seen.events if event.kind == "blink"]
    assert len(events) == 5
    middles = [event.minimum_s for event in events]
    assert middles == pytest.approx([2.143, 5.157, 9.23, 13.134, 16.148], abs=0.03)
    assert np.median([event.end_s - event.onset_s for event in events]) == pytest.approx(0.36, abs=0.05)


def test_durations_of_a_real_recording_do_not_change_with_the_rate(shared_data):
    path = shared_data / "blink_series" / "espbm_sample_ear_short.csv"
    (series,) = read_series(path, ["EAR_r"], 240)
    lengths = {}
    for step in (1, 2, 4, 8):
        (seen,) = recognise([eye(series.distance[::step], 240 / step)])
        lengths[step] = np.median([e.end_s - e.onset_s for e in seen.events if e.kind == "blink"])
    assert max(lengths.values()) < 1.07 * min(lengths.values()), lengths


def test_a_blink_cut_by_a_gap_is_reported_and_the_others_are_measured():
    distance = lids(blinks_at(2, 5, 9, 13, 16), 60.0)
    distance[round(5.1 * 60) : round(6.5 * 60)] = np.nan
    series = eye(distance, 60.0)
    seen = blinks_of(series, DEFAULT_OPTIONS, recognised=recognise([series])[0])
    assert len(seen.blinks) == 4
    assert any("gap" in refused.reason for refused in seen.refused)


def test_gaps_next_to_every_blink_are_measured_without_an_error(make_known):
    known = make_known(noise=0.1)
    distance = known.distance.copy()
    for end in known.ends:
        distance[end + 5 : end + 200] = np.nan
    for options in (None, DEFAULT_OPTIONS):
        series = eye(distance, known.fps)
        seen = recognise([series])[0] if options is None else None
        blinks_of(series, DEFAULT_OPTIONS, recognised=seen)


def test_one_flat_dip_is_refused_and_not_the_whole_file(make_known):
    known = make_known(depths=(1.0, 0.95, 1.0, 1.0))
    distance = known.distance.copy()
    start = known.onsets[1] - 30
    distance[start - 400 : known.ends[1] + 400] *= 0.02
    seen = blinks_of(eye(distance, known.fps), DEFAULT_OPTIONS, closed_distance=2.0)
    assert len(seen.blinks) == 3


def test_both_eyes_are_partnered_and_all_events_are_written(stimuli, series_file, tmp_path):
    arguments = ("--column", "gap_l", "--column", "gap_r", "--fps", 300, "--out", tmp_path / "b.csv")
    assert stimuli("blinks", series_file, *arguments).code == 0
    table = pd.read_csv(tmp_path / "b.csv")
    assert table["partner"].tolist() == [1, 2, 3, 4] * 2
    assert table["partner_lag_ms"].abs().max() < 40
    assert (table["partner_closure"] >= -0.2).all()
    assert table["probability"].between(0.5, 1).all()
    assert (table["closed_from_s"] < table["closed_to_s"]).all()
    events = pd.read_csv(tmp_path / "b.events.csv")
    assert list(events.columns) == list(EVENT_COLUMNS)


def test_uneven_times_are_resampled_on_request(stimuli, tmp_path):
    rng = np.random.default_rng(3)
    even = lids(blinks_at(2, 5, 9, 13, 16), 600.0)
    times = np.cumsum(rng.choice([1 / 60, 1 / 30], 700))
    times = times[times < 19.9]
    path = tmp_path / "s.csv"
    distance = np.interp(times, np.arange(even.size) / 600, even)
    pd.DataFrame({"time_s": times, "gap": distance}).to_csv(path, index=False)
    refused = stimuli("blinks", path, "--out", tmp_path / "b.csv")
    assert refused.code == 2
    assert "--resample" in refused.err
    assert stimuli("blinks", path, "--resample", "--out", tmp_path / "b.csv").code == 0
    found = pd.read_csv(tmp_path / "b.csv")
    assert found["minimum_s"].to_numpy() + times[0] == pytest.approx(
        np.array([2, 5, 9, 13, 16]) + 0.115, abs=0.06
    )


@pytest.mark.parametrize("seconds", [0.7, 3.0, 9.0, 12.0, 30.0])
@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_eyes_that_stay_shut_are_reported_however_long(fps, seconds):
    shut = Motion("closed_eye", 11, 0.2, seconds, 0.4, 0.95)
    later = [11 + seconds + 3 * n for n in (1, 2, 3)]
    (seen,) = recognise([eye(lids([*blinks_at(2, 5, 8), shut, *blinks_at(*later)], fps, seconds + 24), fps)])
    assert [event.kind for event in seen.events] == ["blink"] * 3 + ["closed_eye"] + ["blink"] * 3
    event = seen.events[3]
    assert event.closed_to_s - event.closed_from_s == pytest.approx(seconds, abs=0.3)
    assert_apart(seen.events)


def test_lids_that_are_lowered_for_long_are_not_called_shut():
    lowered = Motion("gaze_shift", 11, 0.2, 20.0, 0.4, 0.5)
    (seen,) = recognise([eye(lids([*blinks_at(2, 5, 8, 34, 37), lowered], 60.0, 40.0), 60.0)])
    assert "closed_eye" not in {event.kind for event in seen.events}
