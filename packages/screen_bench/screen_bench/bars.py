"""The bar code of a frame: upright bars over the whole picture, so that any row shows its number.

Ten bars: white, black, six bits (least significant first), their parity and its opposite. A row that shows
parts of two frames, or the gray surround, does not decode.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BITS = 6
BARS = BITS + 4
BAR_PX, HEIGHT_PX = 96, 360
WIDTH_PX = BARS * BAR_PX
WHITE_LUMA, BLACK_LUMA, GREY_CHROMA = 235, 16, 128
DARK_BELOW, LIGHT_ABOVE = 90, 150
MAX_FRAMES = 1 << BITS

SURROUND, UNREADABLE = -1, -2


def pattern(number: int) -> list[bool]:
    """White (True) and black bars of a frame's number, 0 to 63."""
    if not 0 <= number < MAX_FRAMES:
        raise ValueError(f"expected a frame number from 0 to {MAX_FRAMES - 1}, got {number}")
    bits = [bool(number >> bit & 1) for bit in range(BITS)]
    odd = sum(bits) % 2 == 1
    return [True, False, *bits, odd, not odd]


def planes(number: int, height_px: int = HEIGHT_PX) -> NDArray[np.uint8]:
    """The frame as 4:2:0 planes, uint8 (height * 3 / 2, width)."""
    picture = np.full((height_px * 3 // 2, WIDTH_PX), GREY_CHROMA, np.uint8)
    luma = [WHITE_LUMA if white else BLACK_LUMA for white in pattern(number)]
    picture[:height_px] = np.repeat(np.array(luma, np.uint8), BAR_PX)
    return picture


def read(values: Sequence[int]) -> int:
    """The frame's number from one gray value per bar; SURROUND where all are gray, else UNREADABLE."""
    if all(DARK_BELOW <= value <= LIGHT_ABOVE for value in values):
        return SURROUND
    if any(DARK_BELOW <= value <= LIGHT_ABOVE for value in values):
        return UNREADABLE
    white = [value > LIGHT_ABOVE for value in values]
    number = sum(1 << bit for bit in range(BITS) if white[2 + bit])
    return number if white == pattern(number) else UNREADABLE
