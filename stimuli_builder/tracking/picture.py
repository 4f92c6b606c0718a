"""Pictures reduced by a whole factor, and points carried along."""

import cv2
import numpy as np

from stimuli_builder.compiled import compiled
from stimuli_builder.tracking.shapes import Points
from stimuli_builder.video import Picture


def reduced(picture: Picture, factor: int) -> Picture:
    """Mean of factor x factor blocks; rows and columns that fill no block are left out."""
    if factor == 1:
        return picture
    height, width = (side // factor for side in picture.shape)
    whole = picture[: height * factor, : width * factor]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def reduced_points(points: Points, factor: int) -> Points:
    """Where points of the full picture (pixel centres at integers) lie in the reduced one."""
    return np.asarray((points + 0.5) / factor - 0.5)


def restored_points(points: Points, factor: int) -> Points:
    """Undo `reduced_points`."""
    return np.asarray((points + 0.5) * factor - 0.5)


@compiled
def same_picture(one: Picture, other: Picture) -> bool:
    """Whether two grey pictures of one size are equal, told at the first row that differs."""
    for row in range(one.shape[0]):
        differs = False
        for column in range(one.shape[1]):
            differs |= one[row, column] != other[row, column]
        if differs:
            return False
    return True


@compiled
def shows_something(picture: Picture, grey_levels: int, step: int) -> bool:
    """Whether the grey levels of every step-th row and column span so many, told as soon as they do."""
    low, high = picture[0, 0], picture[0, 0]
    for row in range(0, picture.shape[0], step):
        for column in range(0, picture.shape[1], step):
            low, high = min(low, picture[row, column]), max(high, picture[row, column])
        if high >= low + grey_levels:
            return True
    return False
