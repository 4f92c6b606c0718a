"""From scene light to the picture, and pictures between rendered ones."""

import cv2
import numpy as np
import pytest
from face_baking.assembly import steadied
from face_baking.development import (
    LENS_PX,
    develop,
    error_and_noise,
    photographed,
    psnr_db,
)
from face_baking.inbetween import flow_mix


def test_development_is_monotonic_and_stays_within_the_picture() -> None:
    light = np.linspace(0, 20, 2000, dtype=np.float32)
    code = develop(light, 0.0)
    assert (np.diff(code) >= 0).all()
    assert code[0] == 0
    assert code[-1] <= 1


def test_a_lens_spreads_a_point_and_keeps_its_light() -> None:
    point = np.zeros((21, 21, 3), np.float32)
    point[10, 10] = 0.02  # so dark that development is close to a power function of it, turned round below
    light = _undeveloped(photographed(point, 0.0)[..., 0])
    across = np.arange(21) - 10
    assert light.sum() == pytest.approx(0.02, rel=0.02)
    spread = np.sqrt((light.sum(0) * across**2).sum() / light.sum())
    # The kernel is cut off and sampled at whole pixels, each as wide as the Gaussian itself.
    assert spread == pytest.approx(LENS_PX, rel=0.1)


def test_a_lens_leaves_an_even_picture_and_takes_noise_away() -> None:
    flat = np.full((40, 50, 3), 0.3, np.float32)
    np.testing.assert_allclose(photographed(flat, 0.2), develop(flat, 0.2), atol=1e-6)
    noisy = flat + np.random.default_rng(3).normal(0, 0.02, flat.shape).astype(np.float32)
    assert photographed(noisy, 0.2).std() < 0.65 * develop(noisy, 0.2).std()


def _undeveloped(code: np.ndarray) -> np.ndarray:
    """Light of a code, read off development's own curve."""
    light = np.linspace(0, 0.05, 5000, dtype=np.float32)
    return np.interp(code, develop(light, 0.0), light)


def test_psnr_of_known_pictures() -> None:
    a = np.zeros((4, 4, 3), np.uint8)
    assert psnr_db(a, a) == float("inf")
    assert psnr_db(a, a + np.uint8(255)) == 0.0
    assert psnr_db(a, a + np.uint8(1)) == pytest.approx(48.13, abs=0.01)


def test_the_references_own_noise_is_not_the_pictures_error() -> None:
    rng = np.random.default_rng(9)
    truth = np.full((200, 300, 3), 120.0)
    shown, a, b = (np.round(truth + rng.normal(0, s, truth.shape)).astype(np.uint8) for s in (3, 6, 6))
    error, noise = error_and_noise(shown, a, b)
    assert error == pytest.approx(9, rel=0.03)
    assert noise == pytest.approx(18, rel=0.03)
    assert error_and_noise(a, a, b)[0] == pytest.approx(0, abs=0.2)  # a shown reference is no independent one


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


def test_still_skin_keeps_the_noise_of_many_samples_and_its_change_of_light() -> None:
    rng = np.random.default_rng(6)
    skin = np.full((60, 90, 3), 0.5, np.float32)
    few, many = (skin + rng.normal(0, s, skin.shape).astype(np.float32) for s in (0.02, 0.004))
    darker = few - np.float32(0.008)
    assert np.std(steadied(darker, few, many) - (skin - 0.008)) < 1.3 * np.std(many - skin)


def test_what_moves_is_taken_as_it_was_rendered() -> None:
    opened = np.full((60, 90, 3), 0.5, np.float32)
    lid, many = opened.copy(), opened + np.float32(0.01)
    lid[20:40] = 0.2
    laid = steadied(lid, opened, many)
    np.testing.assert_allclose(laid[25:35], lid[25:35], atol=1e-4)
    np.testing.assert_allclose(laid[:10], many[:10], atol=1e-6)
