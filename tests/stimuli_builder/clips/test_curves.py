"""A blink laid into a clip."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from experiments.load import load_experiment
from stimuli_builder.blinks.blink_model import textbook_profile
from stimuli_builder.clips.curves import (
    LEAD_IN_S,
    LEAD_OUT_S,
    ClipCurve,
    Timing,
    amplitude_of,
    clip_curve,
    with_overshoot,
    within_reach,
)
from stimuli_builder.clips.design_clips import Options, planned_clips
from stimuli_builder.clips.frames import frame_weights

BLINK = textbook_profile("AL", 9, start_level=0.05, end_level=0.1)


@given(st.integers(24, 60), st.integers(0, 9), st.integers(0, 50))
@settings(deadline=None, max_examples=40)
def test_the_eye_rests_before_and_after_the_blink(fps: int, phase: int, seed: int) -> None:
    timing = Timing.drawn(fps, phase, seed)
    curve = clip_curve(BLINK, timing, "none")
    assert np.all(curve.closure[: curve.onset_sample + 1] == 0.05)
    assert curve.closure[-1] == 0.1
    assert curve.closure.max() == 1.0
    frames = len(frame_weights(len(curve.closure), fps, blur=True))
    assert frames >= timing.lead_in_frames + timing.lead_out_frames + int(9 * fps / 30)


def test_lead_lengths_stay_in_their_ranges_and_vary() -> None:
    drawn = [Timing.drawn(30, 0, "cell", number) for number in range(200)]
    lead_in, lead_out = {t.lead_in_frames for t in drawn}, {t.lead_out_frames for t in drawn}
    assert min(lead_in) == round(30 * LEAD_IN_S[0])
    assert max(lead_in) == round(30 * LEAD_IN_S[1])
    assert min(lead_out) == round(30 * LEAD_OUT_S[0])
    assert max(lead_out) == round(30 * LEAD_OUT_S[1])


def test_a_blink_longer_than_the_clip_is_refused() -> None:
    with pytest.raises(InputError, match="longer than the clip of 15 frames"):
        clip_curve(BLINK, Timing(10, 5, 0, 30), "none", clip_frames=15)


def test_a_fixed_clip_length_is_kept() -> None:
    curve = clip_curve(BLINK, Timing(10, 5, 0, 30), "none", clip_frames=40)
    assert len(curve.closure) == 400


@pytest.mark.parametrize(
    ("mode", "moves"),
    [("both", (True, True)), ("vertical", (True, False)), ("horizontal", (False, True))],
)
def test_lower_lid_modes_move_what_they_say(mode: str, moves: tuple[bool, bool]) -> None:
    curve = clip_curve(amplitude_of(BLINK, "full"), Timing(10, 10, 0, 30), mode)
    assert curve.lower_vertical_mm is not None
    assert curve.lower_horizontal_mm is not None
    assert (bool(curve.lower_vertical_mm.any()), bool(curve.lower_horizontal_mm.any())) == moves


def test_a_lower_lid_at_rest_has_no_signal() -> None:
    assert clip_curve(BLINK, Timing(10, 10, 0, 30), "none").lower_vertical_mm is None


@pytest.mark.parametrize("amplitude", ["full", "natural"])
@pytest.mark.parametrize(("anticipation", "settle"), [(1.0, 0.0), (0.0, 1.0), (1.0, 0.5), (0.25, 1.0)])
def test_lids_lift_before_a_blink_and_settle_after_it(
    amplitude: str, anticipation: float, settle: float
) -> None:
    profile = amplitude_of(textbook_profile("AL", 9), amplitude)
    plain = clip_curve(profile, Timing(15, 15, 4, 30), "none")
    curve = with_overshoot(plain, anticipation, settle)
    rest = 0.08 * max(anticipation, settle)
    onset, end = plain.onset_sample, plain.onset_sample + 90
    # It rests lower, lifts in the 39 samples before the blink, and sinks back in the 90 after it.
    assert curve.closure[0] == curve.closure[onset - 39] == curve.closure[-1] == pytest.approx(rest)
    assert curve.closure[onset] == pytest.approx(rest - 0.08 * anticipation, abs=1e-6)
    assert curve.closure[end] == pytest.approx(rest - 0.08 * settle, abs=2e-3)
    assert curve.closure[end + 90] == pytest.approx(rest)
    shut = int(plain.closure.argmax())
    assert curve.closure.argmax() == shut
    if amplitude == "full":
        assert curve.closure[shut] == 1.0
    # No jump: a lid never moves faster than in the blink itself.
    assert np.abs(np.diff(curve.closure)).max() <= np.abs(np.diff(plain.closure)).max() + 1e-6
    assert curve.onset_sample == plain.onset_sample


def test_without_anticipation_and_settle_a_curve_is_itself() -> None:
    plain = clip_curve(BLINK, Timing(10, 10, 0, 30), "none")
    assert with_overshoot(plain, 0.0, 0.0) is plain


@pytest.mark.parametrize("wrong", [-0.1, 1.2, float("nan"), float("inf")])
def test_closure_outside_its_range_is_refused(wrong: float) -> None:
    with pytest.raises(InputError):
        ClipCurve(np.array([0.0, wrong, 0.0]), 0, "bad")


def moved(vertical: list[float], horizontal: list[float]) -> ClipCurve:
    return ClipCurve(
        np.zeros(3),
        0,
        "mine",
        lower_vertical_mm=np.array(vertical),
        lower_horizontal_mm=np.array(horizontal),
    )


REACH = ((0.0, 1.0), (0.0, 5.0))


def test_a_lower_lid_within_reach_is_shown_as_it_is() -> None:
    curve = moved([0.0, 1.0, 0.2], [0.0, 5.0, 1.0])
    shown, said = within_reach(curve, REACH)
    np.testing.assert_array_equal(shown.lower_vertical_mm, curve.lower_vertical_mm)
    np.testing.assert_array_equal(shown.lower_horizontal_mm, curve.lower_horizontal_mm)
    assert said == {}
    assert within_reach(curve, None) == (curve, {})


def test_a_lower_lid_that_wavers_about_rest_is_held_there_and_the_manifest_says_so() -> None:
    shown, said = within_reach(moved([0.0, 1.05, -0.2], [0.0, 2.0, 0.0]), REACH)
    np.testing.assert_array_equal(shown.lower_vertical_mm, [0.0, 1.0, 0.0])
    assert said == {"lower_vertical_held_mm": "0.2000"}


@pytest.mark.parametrize(
    ("vertical", "horizontal", "message"),
    [
        ([0.0, 0.5, 0.0], [0.0, 6.2, 0.0], r"0\.00 to 6\.20 mm toward the nose.*baked for 0 to 5 mm"),
        ([0.0, -0.4, 0.0], [0.0, 2.0, 0.0], r"-0\.40 to 0\.00 mm up.*baked for 0 to 1 mm"),
    ],
)
def test_a_lower_lid_beyond_the_characters_reach_is_refused(
    vertical: list[float], horizontal: list[float], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        within_reach(moved(vertical, horizontal), REACH)


def test_every_lower_lid_of_experiment_3_moves_as_far_as_its_blink() -> None:
    planned = planned_clips(load_experiment("exp3"), Options())
    assert [clip.lower_held for clip in planned] == [{}] * len(planned)
    slides = [
        float(clip.job.curve.lower_horizontal_mm.max())
        for clip in planned
        if clip.job.curve.lower_horizontal_mm is not None and clip.job.curve.lower_horizontal_mm.any()
    ]
    assert 1.3 < min(slides) < 1.8
    assert 4.0 < max(slides) <= 5.0
