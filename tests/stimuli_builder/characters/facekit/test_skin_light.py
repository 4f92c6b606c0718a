"""Light that scatters below the skin, in the picture: what is kept, how far it goes, and where it stops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stimuli_builder.characters.facekit.skin_light import (
    MAXIMUM_RADIUS_PX,
    REACH_CM,
    TAIL,
    diffusion_kernel,
    scattered,
)


@given(st.floats(0.05, 20))
def test_a_kernel_gives_out_what_it_takes_in_and_no_more(reach_px: float) -> None:
    kernel = diffusion_kernel(reach_px)
    assert kernel.sum() == pytest.approx(1)
    assert kernel.min() >= 0
    assert np.allclose(kernel, kernel.T, rtol=1e-12)
    assert kernel.shape[0] // 2 == min(int(np.ceil(TAIL * reach_px)), MAXIMUM_RADIUS_PX)


def test_light_falls_off_as_the_profile_says() -> None:
    """Eq. (1) over a disk, by hand: 1 - exp(-r / d) / 4 - 3 exp(-r / 3 d) / 4 leave within r of the entry."""
    reach = 4.0
    kernel = diffusion_kernel(reach)
    middle = kernel.shape[0] // 2
    rows, columns = np.indices(kernel.shape) - middle
    distance = np.hypot(rows, columns)

    def share(r: float) -> float:
        return float(1 - np.exp(-r / reach) / 4 - 3 * np.exp(-r / (3 * reach)) / 4)

    for radius in (4.5, 8.5, 16.5):
        inside = kernel[distance < radius].sum()
        assert inside == pytest.approx(share(radius) / share(TAIL * reach), abs=0.02)


def test_even_light_stays_as_it_is_up_to_the_edges() -> None:
    light = np.full((40, 50, 3), (0.7, 0.4, 0.2), np.float32)
    assert scattered(light, np.ones((40, 50), np.float32), (6.0, 2.0, 0.5)) == pytest.approx(light, abs=1e-5)


def test_a_shade_gets_a_red_rim_as_red_goes_farthest() -> None:
    light = np.ones((31, 61, 3), np.float32)
    light[:, 30:] = 0
    out = scattered(light, np.ones((31, 61), np.float32), tuple(reach * 75 for reach in REACH_CM))
    red, green, blue = out[15, 33]
    assert red > 2 * green > 2 * blue > 0
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
