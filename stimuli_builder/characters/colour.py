"""Encodings of color: sRGB and linear light, the planes of a video, and blends between levels."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# sRGB code values and linear light (IEC 61966-2-1): the two encodings that pictures have here.


def _linear_table() -> NDArray[np.float32]:
    code = np.arange(256) / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


LINEAR_OF_CODE = _linear_table()


def srgb_to_linear(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light in 0-1, same shape, of 8-bit sRGB code values."""
    return LINEAR_OF_CODE[image]


def encode_srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Gamma-encoded sRGB in 0-1 of linear light; values outside 0-1 are clipped."""
    light = np.clip(linear, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055).astype(np.float32)


def linear_to_srgb(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB code values, rounded to nearest, of linear light."""
    return (encode_srgb(linear) * 255.0 + 0.5).astype(np.uint8)


# Between the baked or drawn levels of a closing eyelid: linear, in linear light.


def level_weights(levels: NDArray[np.float64], closures: ArrayLike) -> NDArray[np.float64]:
    """Weights over the levels that show each closure.

    Parameters
    ----------
    levels : float64 array (n,)
        Closures that there are pictures of, ascending from 0 to 1.
    closures : array-like (m,)
        Closures to be shown, each between 0 and 1.

    Returns
    -------
    float64 array (m, n)
        Each row sums to 1 and has at most two neighbors above 0. The mean of rows is the weight vector of
        motion blur over these closures.

    Examples
    --------
    >>> level_weights(np.array([0.0, 0.5, 1.0]), [0.25, 1.0])
    array([[0.5, 0.5, 0. ],
           [0. , 0. , 1. ]])
    """
    closures = np.asarray(closures, dtype=np.float64)
    # Clipped, so that the ends have a level on either side as well.
    upper = np.clip(np.searchsorted(levels, closures, side="left"), 1, len(levels) - 1)
    low, high = levels[upper - 1], levels[upper]
    share = (closures - low) / (high - low)
    weights = np.zeros((len(closures), len(levels)))
    rows = np.arange(len(closures))
    weights[rows, upper - 1] = 1.0 - share
    weights[rows, upper] += share
    return weights


# Planes in which a level's colors are encoded, and the way back; whole numbers, so every machine agrees.
#
# Brightness and two differences of colors (YCoCg: Malvar & Sullivan 2003, eq. 1) instead of R, G and B. A
# face's three primaries are alike, and H.264 does not predict one plane from another: for the same error the
# differences take a quarter to a third less. In ten bits all three keep every code value:
#
#     y = r + 2 g + b,    o = 512 + 2 (r - b),    n = 512 + 2 g - r - b                 (1)
#     g = (y + n') / 4,   r = (y - n' + o') / 4,  b = (y - n' - o') / 4                 (2)
#
# with r, g, b in 0-255, y in 0-1020, o and n in 2-1022, o' = o - 512, n' = n - 512.

FORMAT = "yuv444p10le"
"""Name of the planes' layout in the video; their stream says nothing of the colors (2)."""
_CODE = np.dtype("<u2")
MIDDLE = 512
"""Code value of no difference between colors."""
Planes = tuple[NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint16]]


def planes_of(picture: NDArray[np.uint8]) -> Planes:
    """Planes y, n, o of equation (1), each (h, w) in 0-1023, of an (h, w, 3) sRGB picture."""
    red, green, blue = (picture[..., k].astype(np.int16) for k in range(3))
    bright, greenish, orange = red + 2 * green + blue, 2 * green - red - blue, 2 * (red - blue)
    return bright.astype(_CODE), _shifted(greenish), _shifted(orange)


def picture_of(planes: Sequence[NDArray[np.uint16]]) -> NDArray[np.uint8]:
    """(h, w, 3) sRGB picture of planes y, n, o by equation (2), rounded and kept within 0-255."""
    bright, greenish, orange = (plane.astype(np.int16) for plane in planes)
    greenish -= MIDDLE
    orange -= MIDDLE
    # Two more, since a shift by two bits rounds down.
    rest = bright - greenish + 2
    out = np.empty((*bright.shape, 3), np.uint8)
    for channel, quadruple in enumerate((rest + orange, bright + greenish + 2, rest - orange)):
        np.clip(quadruple >> 2, 0, 255, out=out[..., channel], casting="unsafe")
    return out


def frame_planes(frame: Any) -> list[NDArray[Any]]:
    """(h, w) views of a decoded frame's planes, without the padding of their rows."""
    kind = _CODE if frame.format.name == FORMAT else np.dtype(np.uint8)
    planes: list[NDArray[Any]] = [
        np.frombuffer(plane, kind).reshape(plane.height, -1) for plane in frame.planes
    ]
    return [plane[: frame.height, : frame.width] for plane in planes]


def _shifted(difference: NDArray[np.int16]) -> NDArray[np.uint16]:
    return np.asarray(difference + MIDDLE, _CODE)


def smooth(low: float, high: float, x: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Smoothstep from 0 at `low` to 1 at `high`; falling where `low` is above `high`."""
    t = np.clip((np.asarray(x, np.float64) - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t))
