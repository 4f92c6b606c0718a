"""The hot loops: adding weighted levels, and linear light to BT.709 4:2:0 planes."""

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled

FULL_SCALE = 65535
Planes = NDArray[np.uint8]
_BLOCK = 4096


def gamma_table() -> NDArray[np.float32]:
    """Gamma-encoded sRGB in 0-1 of every 16-bit linear value."""
    linear = np.arange(FULL_SCALE + 1) / FULL_SCALE
    # IEC 61966-2-1. Tables, as the power takes longer than all the rest of a pixel.
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return encoded.astype(np.float32)


GAMMA = gamma_table()


@compiled
def blend(
    levels: NDArray[np.uint16],
    chosen: NDArray[np.int64],
    weights: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the weighted sum of the chosen rows of `levels` (n, p) into `out` (p,)."""
    for start in range(0, out.shape[0], _BLOCK):
        # Slices with loops from 0 are what the compiler turns into vector instructions (10 times as fast).
        part = out[start : start + _BLOCK]
        part[:] = 0.0
        for k in range(chosen.shape[0]):
            line, weight = levels[chosen[k], start : start + _BLOCK], weights[k]
            for p in range(part.shape[0]):
                part[p] += weight * np.float32(line[p])


@compiled
def add_products(
    changes: NDArray[np.number],
    factors: NDArray[np.number],
    shares: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Add sum over poses p and mattes m of shares[p, m] changes[p] factors[m] to `out` (h, w, 3).

    `changes` is (poses, h, w, 3), `factors` (mattes, h, w, 3); zero shares cost nothing.
    """
    for m in range(shares.shape[1]):
        for p in range(shares.shape[0]):
            share = shares[p, m]
            if share == 0.0:
                continue
            for y in range(out.shape[0]):
                line, change, factor = out[y].ravel(), changes[p, y].ravel(), factors[m, y].ravel()
                for x in range(line.shape[0]):
                    line[x] += share * np.float32(change[x]) * np.float32(factor[x])


# Decision 0150: The builder converts to YUV itself.
@compiled
def to_yuv(
    light: NDArray[np.float32],
    gamma: NDArray[np.float32],
    luma: NDArray[np.uint8],
    blue: NDArray[np.uint8],
    red: NDArray[np.uint8],
) -> None:
    """Convert 16-bit linear light (h, w, 3), h and w even, to limited-range BT.709 4:2:0 planes.

    Chroma is where H.264 puts it by default: on the left one of two luma columns, between two rows;
    it is the [1 2 1] / 4 mean of columns and the mean of the rows.
    """
    height, width, _ = light.shape
    row_blue = np.zeros((2, width), np.float32)
    row_red = np.zeros((2, width), np.float32)
    for y in range(height):
        side = y % 2
        for x in range(width):
            r = gamma[int(min(max(light[y, x, 0], 0.0), 65535.0) + 0.5)]
            g = gamma[int(min(max(light[y, x, 1], 0.0), 65535.0) + 0.5)]
            b = gamma[int(min(max(light[y, x, 2], 0.0), 65535.0) + 0.5)]
            # BT.709's luma, of gamma-encoded values as the standard asks, not of light.
            grey = np.float32(0.2126) * r + np.float32(0.7152) * g + np.float32(0.0722) * b
            # Limited range, 16 to 235, with half a level for rounding: players stretch it, and treat full
            # range each in their own way.
            luma[y, x] = np.uint8(np.float32(16.5) + np.float32(219.0) * grey)
            # 2 (1 - 0.0722) = 1.8556 is the span of b - gray, 2 (1 - 0.2126) = 1.5748 that of r - gray.
            row_blue[side, x] = (b - grey) * np.float32(224.0 / 1.8556)
            row_red[side, x] = (r - grey) * np.float32(224.0 / 1.5748)
        if side == 1:
            for i in range(width // 2):
                x = 2 * i
                # At the picture's edge the column itself takes the place of its left neighbor.
                left, right = max(x - 1, 0), x + 1
                mean_blue = (
                    row_blue[0, left]
                    + 2 * row_blue[0, x]
                    + row_blue[0, right]
                    + row_blue[1, left]
                    + 2 * row_blue[1, x]
                    + row_blue[1, right]
                ) / 8
                mean_red = (
                    row_red[0, left]
                    + 2 * row_red[0, x]
                    + row_red[0, right]
                    + row_red[1, left]
                    + 2 * row_red[1, x]
                    + row_red[1, right]
                ) / 8
                blue[y // 2, i] = np.uint8(np.float32(128.5) + mean_blue)
                red[y // 2, i] = np.uint8(np.float32(128.5) + mean_red)


def split_planes(planes: Planes, width: int, height: int) -> tuple[Planes, Planes, Planes]:
    """Luma, blue-difference and red-difference views of one (height * 3 / 2, width) array."""
    quarter = height // 2 * (width // 2)
    chroma = planes.reshape(-1)[height * width :]
    blue = chroma[:quarter].reshape(height // 2, width // 2)
    red = chroma[quarter:].reshape(height // 2, width // 2)
    return planes[:height], blue, red
