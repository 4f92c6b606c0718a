import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.blinks.export import lower_lid
from stimuli_builder.blinks.profile import (
    BlinkProfile,
    read_profile_table,
    resample,
    resample_phases,
    split_duration,
    to_full_closure,
    to_natural_closure,
    write_profile_table,
)


def profile(peak=0.8, down=27, up=63, name="p", **more):
    closure = np.concatenate([np.linspace(0, peak, down + 1), np.linspace(peak, 0, up + 1)[1:]])
    return BlinkProfile(name, closure, down, down, up, peak, "test", **more)


def test_full_closure_shuts_a_partial_blink():
    full = to_full_closure(profile(peak=0.6))
    assert full.closure.max() == 1.0
    assert full.closure.min() == 0.0
    assert full.amplitude == 1.0


def test_natural_closure_keeps_what_was_measured():
    measured = profile(peak=0.6)
    assert to_natural_closure(measured).closure.max() == pytest.approx(0.6)


def test_full_closure_shuts_both_eyes():
    both = profile(peak=0.6, eye="both", closure_other=profile(peak=0.4).closure)
    full = to_full_closure(both)
    assert full.closure_other is not None
    assert full.closure_other.max() == 1.0


@settings(deadline=None, max_examples=40)
@given(st.floats(1, 60), st.integers(2, 60), st.integers(2, 90))
def test_resampling_gives_the_duration_and_keeps_the_ratio(duration, down, up):
    scaled = resample(profile(down=down, up=up), duration)
    assert scaled.closure.size == round(duration * 10) + 1
    assert scaled.duration_frames_30fps == pytest.approx(round(duration * 10) / 10)
    assert scaled.down_frames == pytest.approx(scaled.closure.size * down / (down + up), abs=1.5)
    assert scaled.closure[scaled.minimum_index] == pytest.approx(0.8)


@settings(deadline=None, max_examples=30)
@given(st.integers(5, 60), st.integers(5, 90))
def test_resampling_there_and_back_keeps_a_straight_profile(down, up):
    original = profile()
    back = resample_phases(resample_phases(original, down, up), original.down_frames, original.up_frames)
    assert back.closure == pytest.approx(original.closure, abs=1e-9)


def test_the_clip_durations_are_whole_frames():
    assert [sum(split_duration(frames, 0.3)) for frames in (7, 9, 11, 13)] == [70, 90, 110, 130]


@pytest.mark.parametrize("duration", [0, -3, 1e9])
def test_an_impossible_duration_is_refused(duration):
    with pytest.raises(InputError, match="a blink lasts"):
        resample(profile(), duration)


@pytest.mark.parametrize(
    ("closure", "message"),
    [
        ([0, 1.5, 0], "between 0 and 1"),
        ([0, np.nan, 0], "between 0 and 1"),
        ([0, 1], "3 or more"),
        ([[0, 1, 0]], "3 or more"),
    ],
)
def test_a_closure_that_is_none_is_refused(closure, message):
    with pytest.raises(InputError, match=message):
        BlinkProfile("p", np.array(closure, dtype=float), 1, 1, 1, 1.0, "test")


def test_a_profile_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        profile().closure[0] = 1


def test_the_lower_lid_stays_in_the_physiological_range():
    for number in range(40):
        vertical, horizontal = lower_lid(profile(peak=1.0, name=f"p{number}"))
        assert 0.5 <= vertical.max() <= 1.0
        assert 1.2 <= horizontal.max() <= 5.0
        assert vertical[0] == horizontal[0] == 0


def test_the_lower_lid_of_a_profile_never_varies():
    first, second = lower_lid(profile()), lower_lid(profile())
    assert (first[1] == second[1]).all()


def test_a_measured_lower_lid_is_kept():
    measured = profile(lower_up_mm=np.full(91, 0.3), lower_nasal_mm=np.full(91, 2.0))
    vertical, horizontal = lower_lid(measured)
    assert vertical.max() == 0.3
    assert horizontal.max() == 2.0


def test_writing_and_reading_a_table_is_the_identity(tmp_path):
    written = [
        profile(name="one", eye="left"),
        profile(name="two", eye="both", closure_other=profile(peak=0.4).closure),
        profile(name="three", lower_up_mm=np.full(91, 0.3), lower_nasal_mm=np.full(91, 2.0)),
    ]
    write_profile_table(tmp_path / "t.csv", written)
    for before, after in zip(written, read_profile_table(tmp_path / "t.csv"), strict=True):
        assert (after.profile_id, after.eye, after.minimum_index) == (
            before.profile_id,
            before.eye,
            before.minimum_index,
        )
        assert after.closure == pytest.approx(before.closure, abs=1e-6)
        assert (after.closure_other is None) == (before.closure_other is None)
        assert (after.lower_up_mm is None) == (before.lower_up_mm is None)


def test_a_table_without_its_columns_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("profile,closure\na,0\n", encoding="utf-8")
    with pytest.raises(InputError, match="the column 'profile_id' is missing; it has profile, closure"):
        read_profile_table(tmp_path / "t.csv")


@pytest.mark.parametrize("frames", [float("nan"), float("inf"), -1.0, 301.0])
def test_a_duration_no_blink_has_is_refused(frames: float) -> None:
    with pytest.raises(InputError, match=r"between 0\.2 and 300 frames at 30 fps, got"):
        split_duration(frames, 0.3)
