"""Light that scatters below the skin, in the picture: what is kept, how far it goes, and where it stops."""

import numpy as np
import pytest
from face_baking.skin_light import (
    REACH_CM,
    diffusion_kernel,
    scattered,
)


@pytest.mark.parametrize("reach_px", [0.33, 0.78, 3.6, 12.0])
def test_a_kernel_has_the_light_that_rays_of_the_profile_bring(reach_px: float) -> None:
    """Two hundred thousand rays from the middle: how many end in that pixel, and how far the others get."""
    rng = np.random.default_rng(7)
    # Eq. (1) over rings is an exponential of d, for one ray in four, and one of 3 d for the others.
    far = rng.random(200_000) < 0.75
    radius = rng.exponential(np.where(far, 3 * reach_px, reach_px))
    angle = rng.uniform(0, 2 * np.pi, len(radius))
    ends = np.round(radius * np.array([np.cos(angle), np.sin(angle)]))
    kernel = diffusion_kernel(reach_px)
    middle = kernel.shape[0] // 2
    kept = np.hypot(*ends[:, np.abs(ends).max(axis=0) <= middle])
    distance = np.hypot(*(np.indices(kernel.shape) - middle))
    assert kernel[middle, middle] == pytest.approx((kept == 0).mean(), abs=0.015)
    for limit in (0.25 * middle, 0.5 * middle):
        assert kernel[distance <= limit].sum() == pytest.approx((kept <= limit).mean(), abs=0.015)
    assert kernel.sum() == pytest.approx(1)


def test_even_light_stays_as_it_is_up_to_the_edges() -> None:
    light = np.full((40, 50, 3), (0.7, 0.4, 0.2), np.float32)
    assert scattered(light, np.ones((40, 50), np.float32), (6.0, 2.0, 0.5)) == pytest.approx(light, abs=1e-5)


def test_a_shade_gets_a_red_rim_as_red_goes_farthest() -> None:
    light = np.ones((31, 61, 3), np.float32)
    light[:, 30:] = 0
    out = scattered(light, np.ones((31, 61), np.float32), tuple(reach * 75 for reach in REACH_CM))
    red, green, blue = out[15, 31]
    assert red > 1.5 * green > 3 * blue > 0.001
    assert np.all(out[15, 10] > 0.97)


def test_no_light_crosses_from_the_eye_into_the_skin() -> None:
    light = np.zeros((30, 30, 3), np.float32)
    light[:, 15:] = 5.0  # a bright eye beside dark skin
    skin = np.zeros((30, 30), np.float32)
    skin[:, :15] = 1
    out = scattered(light, skin, (4.0, 1.0, 0.5))
    assert np.abs(out[:, :15]).max() < 1e-5


def test_what_is_far_from_skin_keeps_its_own_light() -> None:
    light = np.random.default_rng(4).random((90, 20, 1)).astype(np.float32)
    skin = np.zeros((90, 20), np.float32)
    skin[:5] = 1
    assert np.array_equal(scattered(light, skin, (2.0,))[60:], light[60:])
