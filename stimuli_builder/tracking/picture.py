"""Pictures reduced by a whole factor, and points carried along."""

import cv2
import numpy as np

from stimuli_builder.tracking.shapes import Points
from stimuli_builder.video import Picture


def reduced(picture: Picture, factor: int) -> Picture:
    """Mean of factor x factor blocks; rows and columns that fill no block are left out."""
    if factor == 1:
        return picture
    height, width = (side // factor for side in picture.shape)
    whole = np.ascontiguousarray(picture[: height * factor, : width * factor])
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def reduced_points(points: Points, factor: int) -> Points:
    """Where points of the full picture (pixel centres at integers) lie in the reduced one."""
    return np.asarray((points + 0.5) / factor - 0.5)


def restored_points(points: Points, factor: int) -> Points:
    """Undo `reduced_points`."""
    return np.asarray((points + 0.5) * factor - 0.5)
