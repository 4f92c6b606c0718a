"""Planes in which a level's colours are encoded, and the way back; whole numbers, so every machine agrees.

Brightness and two differences of colours (YCoCg: Malvar & Sullivan 2003, eq. 1) instead of R, G and B. A
face's three primaries are alike, and H.264 does not predict one plane from another: for the same error the
differences take a quarter to a third less (decision 0950). In ten bits all three keep every code value:

    y = r + 2 g + b,    o = 512 + 2 (r - b),    n = 512 + 2 g - r - b                 (1)
    g = (y + n') / 4,   r = (y - n' + o') / 4,  b = (y - n' - o') / 4                 (2)

with r, g, b in 0-255, y in 0-1020, o and n in 2-1022, o' = o - 512, n' = n - 512.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT = "yuv444p10le"
"""Name of the planes' layout in the video; their stream says nothing of the colours (2)."""
_CODE = np.dtype("<u2")
MIDDLE = 512
"""Code value of no difference between colours."""
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
