"""Where the patch lies in a film of the screen: the square whose every field turns from white to black."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from experiments.errors import InputError

Grey = NDArray[np.uint8]
Corners = NDArray[np.float32]

RANGE_SHARE = 0.55
"""A field's pixels change by at least this share of the film's greatest change."""
SIDE_PX_MIN = 12
CANDIDATES = 12
QUAD_TOLERANCE = 0.06
FIELD_PX = 16
MIDDLE = slice(5, 11)
"""Of a straightened field of 16 pixels only the middle is read: its rim mixes with the neighbours."""


def range_of(pictures: Iterable[Grey]) -> Grey:
    """How far each pixel's brightness goes, over all pictures; noise is taken off by a small blur."""
    lowest: Grey | None = None
    highest: Grey | None = None
    for picture in pictures:
        smooth = np.asarray(cv2.blur(picture, (3, 3)), np.uint8)
        lowest = smooth if lowest is None else np.minimum(lowest, smooth)
        highest = smooth if highest is None else np.maximum(highest, smooth)
    if lowest is None or highest is None:
        raise InputError("expected a film of the screen, it has no pictures")
    return highest - lowest


def candidates(change: Grey) -> list[Corners]:
    """Four-cornered places that change as a whole, the largest first; corners in clockwise order."""
    level = RANGE_SHARE * float(change.max())
    closed = cv2.morphologyEx((change >= level).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    quads = []
    for outline in sorted(outlines, key=cv2.contourArea, reverse=True)[:CANDIDATES]:
        hull = cv2.convexHull(outline)
        quad = cv2.approxPolyDP(hull, QUAD_TOLERANCE * cv2.arcLength(hull, True), True)
        if len(quad) == 4 and cv2.contourArea(quad) >= SIDE_PX_MIN**2:
            quads.append(_clockwise(quad.reshape(4, 2).astype(np.float32)))
    return quads


def brightness(picture: Grey, corners: Corners) -> NDArray[np.float64]:
    """Mean grey value of each of the nine fields, row by row, 0 to 255."""
    side = 3 * FIELD_PX
    square = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32)
    straight = cv2.warpPerspective(picture, cv2.getPerspectiveTransform(corners, square), (side, side))
    parts = np.asarray(straight, np.float64).reshape(3, FIELD_PX, 3, FIELD_PX)
    means: NDArray[np.float64] = parts[:, MIDDLE, :, MIDDLE].mean(axis=(1, 3))
    return means.reshape(-1)


def _clockwise(corners: Corners) -> Corners:
    around = corners - corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]
