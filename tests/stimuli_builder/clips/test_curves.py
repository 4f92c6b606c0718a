"""A blink laid into a clip."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.blinks.textbook import textbook_profile
from stimuli_builder.clips.curves import (
    LEAD_IN_S,
    LEAD_OUT_S,
    ClipCurve,
    Timing,
    amplitude_of,
    clip_curve,
    within_reach,
)
from stimuli_builder.clips.motion_blur import frame_weights

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


@pytest.mark.parametrize("wrong", [-0.1, 1.2, float("nan"), float("inf")])
def test_closure_outside_its_range_is_refused(wrong: float) -> None:
    with pytest.raises(InputError):
        ClipCurve(np.array([0.0, wrong, 0.0]), 0, "bad")


def test_a_lower_lid_beyond_the_characters_reach_is_scaled_as_a_whole() -> None:
    curve = clip_curve(amplitude_of(BLINK, "full"), Timing(10, 10, 0, 30), "both")
    assert curve.lower_horizontal_mm is not None
    scaled, said = within_reach(curve, (5.0, 0.7))
    assert scaled.lower_horizontal_mm is not None
    assert scaled.lower_horizontal_mm.max() == pytest.approx(0.7, abs=1e-5)
    factor = 0.7 / curve.lower_horizontal_mm.max()
    np.testing.assert_allclose(scaled.lower_horizontal_mm, curve.lower_horizontal_mm * factor, atol=2e-6)
    assert said == {"lower_horizontal_scale": f"{factor:.4f}"}
    assert within_reach(curve, None)[1] == {}
