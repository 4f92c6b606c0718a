"""Geometry of the synthetic eyes in eye widths: lid margins, landmarks, and where they lie in the picture.

Axes of one eye: u runs from the outer (-0.5) to the inner canthus (0.5), v down; unit: width of the fissure.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled

Values = NDArray[np.float64]

PICTURE_SIZE = (512, 384)
EYE_WIDTH_PX = 76.0
EYE_CENTRES = ((160.0, 196.0), (352.0, 196.0))
# One eye width stands for 30 mm: on closing, the lower lid rises 0.75 mm and moves 2.4 mm to the nose.
LOWER_LIFT = 0.025
LOWER_NASAL = 0.08
UPPER_NASAL = 0.02
TILT = 0.05
UPPER_PLACES = (-0.3, -0.1, 0.1, 0.3)
LOWER_PLACES = (0.25, 0.0, -0.25)


@compiled
def arch(u: float) -> float:
    """1 in the middle of the fissure, 0 at the canthi."""
    return max(0.0, 1.0 - 4.0 * u * u)


@compiled
def rounded_arch(u: float) -> float:
    """The arch to the power 3/4: steep at the canthi, flat in the middle."""
    root = sqrt(arch(u))
    return root * sqrt(root)


@compiled
def upper_open(u: float) -> float:
    """Margin of the upper lid of the open eye, v at u."""
    return float(-0.25 * rounded_arch(u) * (1.0 + 0.22 * u) + TILT * u)


@compiled
def lower_margin(u: float, closure: float) -> float:
    """Margin of the lower lid, v at u."""
    return float(
        0.115 * rounded_arch(u) * (1.0 - 0.15 * u) + TILT * u - LOWER_LIFT * max(closure, 0.0) * arch(u)
    )


@compiled
def upper_margin(u: float, closure: float) -> float:
    """Margin of the upper lid: it sweeps down to meet the lower one at closure 1."""
    return (1.0 - closure) * upper_open(u) + closure * lower_margin(u, closure)


def eye_landmarks(closure: float) -> Values:
    """The 9 landmarks of one eye in (u, v), outer canthus first: (9, 2)."""
    shut = max(closure, 0.0)
    upper = [u + UPPER_NASAL * shut * arch(u) for u in UPPER_PLACES]
    lower = [u + LOWER_NASAL * shut * arch(u) for u in LOWER_PLACES]
    return np.array(
        [
            (-0.5, upper_margin(-0.5, closure)),
            *((u, upper_margin(u, closure)) for u in upper),
            (0.5, upper_margin(0.5, closure)),
            *((u, lower_margin(u, closure)) for u in lower),
        ]
    )


def head_matrix(head: Values) -> Values:
    """The 2 x 3 matrix from the face at rest to the picture, turning about the picture's center."""
    shift_x, shift_y, turn, scale = head
    centre = np.array(PICTURE_SIZE) / 2
    a, b = scale * np.cos(turn), scale * np.sin(turn)
    linear = np.array([[a, -b], [b, a]])
    return np.asarray(np.c_[linear, centre - linear @ centre + [shift_x, shift_y]])


def landmarks(closure: Values, head: Values) -> Values:
    """The 18 landmarks in picture pixels, image-left eye first: (18, 2).

    Parameters
    ----------
    closure : float64 array (2,)
        Of the image-left and image-right eye.
    head : float64 array (4,)
        Shift x, shift y, turn, scale.
    """
    parts = []
    for eye, centre in enumerate(EYE_CENTRES):
        local = eye_landmarks(float(closure[eye])) * EYE_WIDTH_PX
        parts.append(local * [1 - 2 * eye, 1] + centre)
    matrix = head_matrix(head)
    return np.asarray(np.concatenate(parts) @ matrix[:, :2].T + matrix[:, 2])


def lid_distances(points: Values) -> Values:
    """Inter-eyelid distance of each eye from 18 landmarks, as `stimuli track` defines it: (2,) pixels."""
    distances = []
    for first in (0, 9):
        eye = points[first : first + 9]
        along = (eye[5] - eye[0]) * np.sign(eye[5, 0] - eye[0, 0])
        gap = eye[7] - (eye[2] + eye[3]) / 2
        distances.append((along[0] * gap[1] - along[1] * gap[0]) / np.hypot(*along))
    return np.maximum(distances, 0.0)
