import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.blinks.blink_model import TEXTBOOK_KINDS, recorded_down_fraction, textbook_profile

KINDS = st.sampled_from(TEXTBOOK_KINDS)


@settings(deadline=None, max_examples=40)
@given(KINDS, st.integers(3, 40), st.floats(0, 0.2), st.floats(0, 0.2), st.floats(0, 0.99))
def test_a_textbook_blink_closes_and_reopens_monotonically(kind, duration, start, end, phase):
    blink = textbook_profile(kind, duration, start_level=start, end_level=end, subframe_phase=phase)
    assert blink.closure[0] == pytest.approx(start)
    assert blink.closure[-1] == pytest.approx(end)
    assert blink.closure.max() == blink.closure[blink.minimum_index] == 1.0
    assert (np.diff(blink.closure[: blink.minimum_index + 1]) >= -1e-12).all()
    assert (np.diff(blink.closure[blink.minimum_index :]) <= 1e-12).all()
    assert blink.duration_frames_30fps == pytest.approx(duration)


@pytest.mark.parametrize("kind", ["SL", "SL_ease"])
def test_symmetric_blinks_read_the_same_backwards(kind):
    closure = textbook_profile(kind, 8).closure
    assert closure == pytest.approx(closure[::-1])


@pytest.mark.parametrize("kind", ["AL", "AL_ease"])
def test_asymmetric_blinks_share_their_phases_as_recorded_ones(kind):
    blink = textbook_profile(kind, 9)
    assert blink.down_fraction == pytest.approx(recorded_down_fraction(), abs=0.006)
    assert blink.down_fraction < 0.45


def test_a_linear_blink_moves_evenly():
    closure = textbook_profile("SL", 9).closure
    assert np.diff(closure[:46]) == pytest.approx(np.full(45, 1 / 45))


def test_a_third_as_handle_is_the_smooth_step():
    closure = textbook_profile("SL_ease", 10).closure[:51]
    u = np.linspace(0, 1, 51)
    assert closure == pytest.approx(3 * u**2 - 2 * u**3)


def test_longer_handles_make_a_steeper_middle():
    steep, plain = (textbook_profile("SL_ease", 10, handle=h).closure for h in (0.5, 1 / 3))
    assert np.diff(steep).max() > np.diff(plain).max()


def test_the_subframe_phase_holds_the_start_level():
    blink = textbook_profile("SL", 7, subframe_phase=0.35, start_level=0.02)
    assert (blink.closure[:4] == 0.02).all()
    assert blink.onset_index == 3
    assert blink.closure.size == 74


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kind": "SL_eas", "duration_frames": 9}, "did you mean 'SL_ease'"),
        ({"kind": "SL", "duration_frames": 0}, "a blink lasts"),
        ({"kind": "SL", "duration_frames": 9, "start_level": 1.0}, "levels need"),
        ({"kind": "SL", "duration_frames": 9, "subframe_phase": 1.0}, "sub-frame phase"),
        ({"kind": "SL", "duration_frames": 9, "handle": 2}, "handle"),
    ],
)
def test_impossible_textbook_blinks_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        textbook_profile(**arguments)
