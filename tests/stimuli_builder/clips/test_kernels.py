"""The hot loops against plain numpy."""

import numpy as np
import pytest

from stimuli_builder.clips.frames import BITS, CELL_PX, draw_barcode, read_barcode
from stimuli_builder.clips.kernels import GAMMA, add_products, blend, to_yuv

RNG = np.random.default_rng(4)


def test_blend_is_the_weighted_sum() -> None:
    levels = RNG.integers(0, 65536, (9, 10_007), dtype=np.uint16)
    chosen = np.array([1, 4, 5, 8])
    weights = np.array([0.1, 0.4, 0.3, 0.2], np.float32)
    out = np.empty(10_007, np.float32)
    blend(levels, chosen, weights, out)
    np.testing.assert_allclose(out, weights @ levels[chosen].astype(np.float64), rtol=1e-5)


def test_products_are_summed_over_poses_and_mattes() -> None:
    changes = RNG.normal(size=(3, 4, 5, 3)).astype(np.float32)
    factors = RNG.uniform(size=(2, 4, 5, 3)).astype(np.float32)
    shares = RNG.uniform(size=(3, 2)).astype(np.float32)
    out = np.zeros((4, 5, 3), np.float32)
    add_products(changes, factors, shares, out)
    np.testing.assert_allclose(out, np.einsum("pm,pyxc,myxc->yxc", shares, changes, factors), atol=1e-5)


@pytest.mark.parametrize(
    ("rgb", "yuv"),
    [
        # ITU-R BT.709, limited range: the 100% color bars of Rec. BT.709-6 table values.
        ((1, 1, 1), (235, 128, 128)),
        ((0, 0, 0), (16, 128, 128)),
        ((1, 0, 0), (63, 102, 240)),
        ((0, 1, 0), (173, 42, 26)),
        ((0, 0, 1), (32, 240, 118)),
    ],
)
def test_colour_bars_have_their_bt709_codes(rgb: tuple[int, ...], yuv: tuple[int, ...]) -> None:
    light = np.broadcast_to(np.array(rgb, np.float32) * 65535, (4, 6, 3)).copy()
    luma, blue, red = np.empty((4, 6), np.uint8), np.empty((2, 3), np.uint8), np.empty((2, 3), np.uint8)
    to_yuv(light, GAMMA, luma, blue, red)
    assert (luma[2, 3], blue[1, 1], red[1, 1]) == yuv
    assert len(np.unique(luma)) == len(np.unique(blue)) == 1


def test_chroma_is_the_mean_around_its_place() -> None:
    light = np.zeros((2, 4, 3), np.float32)
    light[:, 2] = (0, 0, 65535)
    luma, blue, red = np.empty((2, 4), np.uint8), np.empty((1, 2), np.uint8), np.empty((1, 2), np.uint8)
    to_yuv(light, GAMMA, luma, blue, red)
    assert blue[0].tolist() == [128, 128 + 112 // 2]


@pytest.mark.parametrize("number", [0, 1, 37, 2048, 4095])
def test_the_barcode_reads_back(number: int) -> None:
    luma, blue, red = (np.full(shape, 90, np.uint8) for shape in ((120, 320), (60, 160), (60, 160)))
    draw_barcode(luma, blue, red, number)
    assert read_barcode(luma) == number
    assert luma[-CELL_PX - 1].max() == 90
    assert (luma[:, CELL_PX * (BITS + 2) :] == 90).all()


def test_a_picture_without_barcode_reads_none() -> None:
    assert read_barcode(np.full((120, 320), 16, np.uint8)) is None
