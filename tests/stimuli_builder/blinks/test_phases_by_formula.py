"""Phases and amplitude of blinks against formulas: rates of 30 to 1,000, gaze shifts about them, noise."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from stimuli_builder.blinks.events.recognise import recognise
from stimuli_builder.blinks.extract import blinks_of
from stimuli_builder.blinks.labelling import preset
from stimuli_builder.blinks.measure import MeasuredBlink
from stimuli_builder.blinks.plots import series_figure
from stimuli_builder.blinks.series import BlinkSeries
from stimuli_builder.blinks.tables import blinks_frame, summarise
from tests.helpers.analytic_blinks import FORMS, GAZES, KnownBlink, analytic_recording

RATES = (30.0, 60.0, 120.0, 240.0, 500.0, 1000.0)
APART = ("none", "down before, up long after", "down just before, up just after", "before", "after")
"""Gaze shifts that are over before the blink, or begin after it."""
CASES = Path("../shared/cases/blinks")


def measured(distance: np.ndarray, fps: float) -> list[MeasuredBlink]:
    series = BlinkSeries(distance=distance, fps=fps, column="d", is_px=True)
    (seen,) = recognise([series])
    return list(blinks_of(series, preset("velocity"), recognised=seen).blinks)


def matched(found: list[MeasuredBlink], known: list[KnownBlink]) -> list[tuple[MeasuredBlink, KnownBlink]]:
    pairs = [(min(found, key=lambda b: abs(b.minimum_s - k.minimum_s)), k) for k in known]
    return [(blink, one) for blink, one in pairs if abs(blink.minimum_s - one.minimum_s) < 0.1]


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("gaze", APART)
def test_phases_and_amplitude_are_the_formulas_beside_gaze_shifts(fps: float, gaze: str) -> None:
    duration, closing, amplitude, count = [], [], [], 0
    for seed, (form, depth, noise) in enumerate(
        (form, depth, noise) for form in FORMS.values() for depth in (1.0, 0.4) for noise in (0.003, 0.01)
    ):
        distance, known = analytic_recording(fps, seed, form, depth, gaze, noise)
        pairs = matched(measured(distance, fps), known)
        count += len(known)
        duration += [b.duration_ms - 1000 * (k.end_s - k.onset_s) for b, k in pairs]
        closing += [b.down_ms - 1000 * (k.minimum_s - k.onset_s) for b, k in pairs]
        amplitude += [b.amplitude / k.amplitude - 1 for b, k in pairs]
    frame_ms = 1000 / fps
    assert len(duration) >= 0.8 * count
    assert np.median(np.abs(duration)) < 3 + 0.1 * frame_ms
    assert np.percentile(np.abs(duration), 95) < 10 + 0.5 * frame_ms
    assert abs(np.median(closing)) < 6
    assert abs(np.median(amplitude)) < 0.01
    assert np.percentile(np.abs(amplitude), 95) < 0.07
    assert np.max(np.abs(duration)) < 200


@pytest.mark.parametrize("fps", [30.0, 120.0, 500.0])
@pytest.mark.parametrize("gaze", ["during", "while opening"])
def test_a_gaze_shift_within_a_full_blink_moves_its_phases_little(fps: float, gaze: str) -> None:
    for seed, form in enumerate(FORMS.values()):
        distance, known = analytic_recording(fps, seed, form, 1.0, gaze, 0.005)
        pairs = matched(measured(distance, fps), known)
        assert len(pairs) == len(known)
        assert max(abs(b.duration_ms - 1000 * (k.end_s - k.onset_s)) for b, k in pairs) < 40


@pytest.mark.parametrize("fps", RATES)
def test_the_stated_error_of_a_duration_holds(fps: float) -> None:
    scores = []
    for seed, form in enumerate(FORMS.values()):
        distance, known = analytic_recording(fps, seed, form, 0.6, "before", 0.01)
        pairs = matched(measured(distance, fps), known)
        scores += [(b.duration_ms - 1000 * (k.end_s - k.onset_s)) / b.duration_error_ms for b, k in pairs]
    assert np.mean(np.abs(scores) < 2) > 0.85
    assert np.sqrt(np.mean(np.square(scores))) > 0.1  # an error as wide as the blink would say nothing


def test_an_implausible_blink_is_flagged_and_in_no_median() -> None:
    distance, _ = analytic_recording(120.0, 3, FORMS["usual"], 1.0, "none", 0.005)
    series = BlinkSeries(distance=distance, fps=120.0, column="d", is_px=True)
    (seen,) = recognise([series])
    first = blinks_of(series, preset("velocity"), recognised=seen).blinks[1]
    moved = {first.minimum_frame: (first.onset_frame - 200, first.end_frame)}
    eye = blinks_of(series, preset("velocity"), recognised=seen, edges=moved)
    assert [blink.plausible for blink in eye.blinks].count(False) == 1
    frame = blinks_frame(eye.blinks, {})
    summary = summarise(eye, frame, [])
    assert (summary["blinks"], summary["implausible"]) == (7, 1)
    assert summary["duration_ms"]["max"] < 400 < frame["duration_ms"].max()
    assert sum(summary["duration_histogram"]["counts"]) == 6


def test_both_eyes_of_a_plot_are_seen_whole() -> None:
    eyes = []
    for number, opening in enumerate((4.0, 11.0)):
        distance, _ = analytic_recording(60.0, number, FORMS["usual"], 1.0, "none", 0.003, opening)
        series = BlinkSeries(distance=distance, fps=60.0, column=f"d{number}", is_px=False)
        eyes.append(blinks_of(series, preset("velocity"), recognised=recognise([series])[0]))
    for order in (eyes, eyes[::-1]):
        for axes in series_figure(order, set()).axes:
            assert axes.get_ylim()[1] > 11


def test_partial_blinks_on_downgaze_do_not_run_to_the_gaze_shift(stimuli, tmp_path: Path) -> None:
    path = CASES / "partial_blinks_on_downgaze_120fps.csv"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    ended = stimuli("blinks", path, "--out", tmp_path / "b.csv")
    assert ended.code == 0, ended.err
    table = pd.read_csv(tmp_path / "b.csv")
    assert table["minimum_s"].to_numpy() == pytest.approx(np.arange(2, 27, 4) + 0.1, abs=0.03)
    assert table["duration_ms"].between(250, 350).all()


@pytest.mark.parametrize("gaze", list(GAZES))
def test_no_phase_reaches_beyond_the_next_blink(gaze: str) -> None:
    for seed in range(4):
        distance, _ = analytic_recording(90.0, seed, FORMS["long"], 0.35, gaze, 0.015)
        found = measured(distance, 90.0)
        assert all(one.end_s <= other.onset_s for one, other in pairwise(found))
        assert all(blink.duration_ms < 1300 for blink in found)
