"""What a motion check may show, as masks on the lattice of its dots."""

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Generator = np.random.Generator

LATTICE = 60
"""Dots along each side of the picture."""
JITTER = 4
"""How many dots what is shown may stand away from the middle."""

_DIGITS = (
    "00100 01100 00100 00100 00100 00100 01110",
    "01110 10001 00001 00110 01000 10000 11111",
    "01110 10001 00001 00110 00001 10001 01110",
    "00010 00110 01010 10010 11111 00010 00010",
    "11111 10000 11110 00001 00001 10001 01110",
    "01110 10000 10000 11110 10001 10001 01110",
    "11111 00001 00010 00100 00100 01000 01000",
    "01110 10001 10001 01110 10001 10001 01110",
    "01110 10001 10001 01111 00001 00001 01110",
)
"""The digits from 1 to 9, row by row: no font is needed, and every machine draws the same."""
_DOTS_A_PIXEL = 6


def digit(answer: int) -> Mask:
    """The digit `answer`, (42, 30) dots."""
    rows = [[dot == "1" for dot in row] for row in _DIGITS[answer - 1].split()]
    return np.kron(np.array(rows), np.ones((_DOTS_A_PIXEL, _DOTS_A_PIXEL))).astype(bool)


def shape(answer: int) -> Mask:
    """Circle, square, triangle or cross by the number of the answer, (36, 36) dots, of about one area."""
    down, across = np.mgrid[0:36, 0:36] - 17.5
    if answer == 1:
        return np.asarray(np.hypot(down, across) < 15.5)
    if answer == 2:
        return np.asarray((abs(down) < 14) & (abs(across) < 14))
    if answer == 3:
        return np.asarray(abs(across) * 2 < down + 18)
    return np.asarray((abs(down) < 6.5) | (abs(across) < 6.5))


def placed(shown: Mask, rng: Generator) -> Mask:
    """A mask of the whole lattice with `shown` near its middle."""
    mask = np.zeros((LATTICE, LATTICE), bool)
    top, left = ((LATTICE - side) // 2 + int(rng.integers(-JITTER, JITTER + 1)) for side in shown.shape)
    mask[top : top + shown.shape[0], left : left + shown.shape[1]] = shown
    return mask
