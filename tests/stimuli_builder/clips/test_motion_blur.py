"""Which samples an output frame shows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.errors import InputError
from stimuli_builder.clips.frames import frame_weights


def test_blur_at_30_fps_is_the_mean_of_ten_samples() -> None:
    weights = frame_weights(40, 30, blur=True)
    assert weights.shape == (4, 40)
    np.testing.assert_allclose(weights[2, 20:30], 0.1)
    assert weights[2].sum() == pytest.approx(1.0)


def test_without_blur_every_tenth_sample_is_shown_alone() -> None:
    weights = frame_weights(40, 30, blur=False)
    np.testing.assert_array_equal(weights.argmax(1), [5, 15, 25, 35])
    np.testing.assert_array_equal(np.sort(weights, axis=1)[:, -2:], [[0, 1]] * 4)


@given(st.integers(24, 60), st.integers(13, 400), st.booleans())
@settings(deadline=None, max_examples=40)
def test_every_frame_is_a_mean_of_its_own_time(fps: int, samples: int, blur: bool) -> None:
    weights = frame_weights(samples, fps, blur)
    np.testing.assert_allclose(weights.sum(1), 1.0)
    assert (weights >= 0).all()
    middles = weights @ (np.arange(samples) + 0.5)
    off = np.abs(middles - (np.arange(len(weights)) + 0.5) * 300 / fps)
    # A sample cut by the end of a frame counts at its middle, hence the small difference.
    assert off.max() <= (0.1 if blur else 1.0)


def test_blur_at_24_fps_shares_the_samples_between_frames() -> None:
    total = frame_weights(300, 24, blur=True).sum(0)
    np.testing.assert_allclose(total, 24 / 300)


def test_a_signal_shorter_than_a_frame_is_refused() -> None:
    with pytest.raises(InputError, match="less than one frame"):
        frame_weights(9, 30, blur=True)
