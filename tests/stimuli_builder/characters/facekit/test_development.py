"""From scene light to the picture, and pictures between rendered ones."""

import cv2
import numpy as np
import pytest

from stimuli_builder.characters.facekit.development import develop, psnr_db
from stimuli_builder.characters.facekit.inbetween import flow_mix


def test_development_is_monotonic_and_stays_within_the_picture() -> None:
    light = np.linspace(0, 20, 2000, dtype=np.float32)
    code = develop(light, 0.0)
    assert (np.diff(code) >= 0).all()
    assert code[0] == 0
    assert code[-1] <= 1


def test_psnr_of_known_pictures() -> None:
    a = np.zeros((4, 4, 3), np.uint8)
    assert psnr_db(a, a) == float("inf")
    assert psnr_db(a, a + np.uint8(255)) == 0.0
    assert psnr_db(a, a + np.uint8(1)) == pytest.approx(48.13, abs=0.01)


def test_flow_carries_a_shifted_picture_half_way() -> None:
    rng = np.random.default_rng(4)
    blobs = cv2.GaussianBlur(rng.random((80, 120, 3), np.float32), (0, 0), 4)
    blobs = (blobs - blobs.min()) / (blobs.max() - blobs.min())
    low, truth, high = blobs, np.roll(blobs, 2, axis=0), np.roll(blobs, 4, axis=0)
    made, faded = flow_mix(low, high, 0.5), (low + high) / 2
    inside = (slice(20, 60), slice(20, 100))
    moved_error = np.abs(made[inside] - truth[inside]).mean()
    assert moved_error < 0.3 * np.abs(faded[inside] - truth[inside]).mean()


def test_in_between_of_equal_levels_is_that_level() -> None:
    flat = np.full((90, 200, 3), 0.25, np.float32)
    np.testing.assert_allclose(flow_mix(flat, flat, 0.5), flat, atol=1e-5)
