"""Whether the points of a label file can be the lids of eyes."""

import numpy as np

from experiments.errors import InputError
from stimuli_builder.tracking.shapes import EYE_POINTS, Points, eye_axis

ORDER_TOLERANCE = 0.06
CROSSING_TOLERANCE = 0.12


def check_frame(where: str, points: Points, eyes: int, size: tuple[int, int]) -> None:
    """Refuse points of a frame that lie outside its picture, or that no eye has.

    Parameters
    ----------
    where : str
        File and frame, to begin the line with.
    points : (9 or 18, 2) float64 array
        In pixels.
    eyes : int
    size : (int, int)
        Width and height of the picture.

    Raises
    ------
    InputError
        One line that names the first wrong point.
    """
    outside = np.flatnonzero(((points < -0.5) | (points > np.array(size) - 0.5)).any(1))
    if len(outside):
        x, y = points[outside[0]]
        raise InputError(
            f"{where}: point {outside[0] + 1} at ({x:g}, {y:g}) is outside the picture "
            f"of {size[0]} x {size[1]}"
        )
    centres = [
        points[start : start + EYE_POINTS].mean(0)[0] for start in range(0, eyes * EYE_POINTS, EYE_POINTS)
    ]
    if centres != sorted(centres):
        raise InputError(f"{where}: the eyes are swapped; points 1 to 9 belong to the image-left eye")
    for eye in range(eyes):
        _check_eye(where, points[EYE_POINTS * eye : EYE_POINTS * (eye + 1)], EYE_POINTS * eye)


def _check_eye(where: str, eye: Points, first: int) -> None:
    """Refuse an eye whose outline crosses itself by more than the wobble of a closed eye's labels."""
    if np.hypot(*(eye[5] - eye[0])) < 4:
        raise InputError(
            f"{where}: canthi {first + 1} and {first + 6} are under 4 px apart; label a larger eye"
        )
    along, down, width = eye_axis(eye)
    x, y = (eye - eye[0]) @ along / width, (eye - eye[0]) @ down / width
    sign = 1.0 if x[5] > 0 else -1.0
    upper, lower = sign * x[:6], sign * x[[5, 6, 7, 8, 0]]
    for order, names in ((np.diff(upper), range(6)), (-np.diff(lower), (5, 6, 7, 8, 0))):
        wrong = np.flatnonzero(order < -ORDER_TOLERANCE)
        if len(wrong):
            a, b = list(names)[wrong[0]], list(names)[wrong[0] + 1]
            raise InputError(
                f"{where}: points {first + a + 1} and {first + b + 1} cross; check the point order"
            )
    steps = np.argsort(upper)
    upper_y = np.interp(sign * x[6:9], upper[steps], y[:6][steps])
    crossed = np.flatnonzero(upper_y - y[6:9] > CROSSING_TOLERANCE)
    if len(crossed):
        raise InputError(
            f"{where}: lower-lid point {first + 7 + crossed[0]} lies above the upper lid; they cross"
        )
