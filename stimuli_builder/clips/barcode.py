"""The test barcode: a frame's number drawn in the picture, for tests that read back what was shown.

Bottom-left corner, cells of 16 x 16 px from left to right: a white and a black guard cell, then 12 bits,
least significant first; white is 1.
"""

import numpy as np
from numpy.typing import NDArray

CELL_PX = 16
BITS = 12
WHITE_LUMA, BLACK_LUMA, GREY_CHROMA = 235, 16, 128


def cells(number: int) -> list[bool]:
    """White (True) and black cells of a frame number, guard cells first; numbers wrap at 4096."""
    return [True, False, *(bool(number >> bit & 1) for bit in range(BITS))]


def draw_barcode(
    luma: NDArray[np.uint8], blue: NDArray[np.uint8], red: NDArray[np.uint8], number: int
) -> None:
    """Draw a frame's number into 4:2:0 planes, in place."""
    pattern = cells(number)
    half = CELL_PX // 2
    for plane in (blue, red):
        plane[-half:, : half * len(pattern)] = GREY_CHROMA
    for index, white in enumerate(pattern):
        luma[-CELL_PX:, index * CELL_PX : (index + 1) * CELL_PX] = WHITE_LUMA if white else BLACK_LUMA


def read_barcode(luma: NDArray[np.uint8]) -> int | None:
    """The frame number in a decoded picture (height, width) of luma or grey; None where there is none."""
    middles = luma[luma.shape[0] - CELL_PX // 2, CELL_PX // 2 : CELL_PX * (BITS + 2) : CELL_PX]
    white = middles > 125
    if not (white[0] and not white[1]):
        return None
    return int(sum(1 << bit for bit in range(BITS) if white[2 + bit]))
