"""The still face: globe, lid margins, fold crest and the closed-eye skin surface, in mm.

Figures follow ordinary adult anatomy (fissure 28 mm long, globe radius 12.2, cornea radius 7.9).
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter

from stimuli_builder.characters.photorealistic.curves import (
    Array,
    bell,
    smooth_maximum,
    soft_maximum,
    step,
)

EYE_X_MM = 30.0
GLOBE_RADIUS_MM = 12.2
CORNEA_RADIUS_MM = 7.9
CORNEA_CENTRE_Z_MM = 5.3
IRIS_RADIUS_MM = 5.9
LID_THICKNESS_MM = 1.6
CANTHUS_NASAL, CANTHUS_TEMPORAL = (-14.9, -1.9), (13.3, 0.7)
OPENING_MM = 11.0

_LOWER_MARGIN = [
    (-14.9, -1.9), (-14.0, -2.65), (-12.5, -3.4), (-10, -4.45), (-7, -5.6), (-3.5, -6.5),
    (0, -6.95), (3.5, -6.85), (6.5, -5.95), (9, -4.45), (11.2, -2.4), (12.6, -0.5), (13.3, 0.7),
]  # fmt: skip
# Visible height of the open fissure; its peak is scaled to OPENING_MM.
_OPEN_FISSURE = [
    (-14.9, 0.0), (-14.0, 0.75), (-12.5, 2.1), (-10.5, 4.5), (-7.5, 7.9), (-4, 10.1), (-0.6, 11.0),
    (2.5, 10.75), (6, 8.95), (9, 6.2), (11.5, 2.9), (12.7, 0.95), (13.3, 0.0),
]  # fmt: skip
_FOLD_CREST = [
    (-22, 1.2), (-17, 1.5), (-14, 2.7), (-11, 5.0), (-7, 7.5), (-2, 8.95), (3, 9.1), (8, 7.9),
    (12, 5.7), (15, 3.7), (19, 1.0), (24, -2.0),
]  # fmt: skip
_NOSE_HEIGHT = [
    (-60, 30), (-45, 27), (-35, 22.5), (-25, 17), (-15, 11.2), (-7, 7.2), (0, 5), (6, 4), (12, 3.4),
    (18, 2.2), (30, 0.5),
]  # fmt: skip
_NOSE_WIDTH = [(-50, 9.5), (-30, 8.2), (-15, 7.0), (0, 6.4), (12, 7.5), (25, 10)]


def _smooth_curve(
    knots: Sequence[tuple[float, float]], sigma: float, count: int = 900
) -> tuple[Array, Array]:
    """Sampled monotone spline through the knots, rounded; the end points stay where they are."""
    x, y = np.array(knots, dtype=float).T
    at = np.linspace(x[0], x[-1], count)
    values = PchipInterpolator(x, y)(at)
    chord = np.linspace(values[0], values[-1], count)
    bump = values - chord
    mirrored = np.concatenate([-bump[::-1], bump, -bump[::-1]])
    return at, chord + gaussian_filter(mirrored, sigma)[count : 2 * count]


_LOWER = _smooth_curve(_LOWER_MARGIN, 13)
_FISSURE = _smooth_curve(_OPEN_FISSURE, 13)
_CREST = _smooth_curve(_FOLD_CREST, 25)
_ACROSS_Y = np.linspace(-60, 60, 600)
_NOSE_Z = gaussian_filter(np.interp(_ACROSS_Y, *np.array(_NOSE_HEIGHT, dtype=float).T), 15)
_NOSE_SIGMA = gaussian_filter(np.interp(_ACROSS_Y, *np.array(_NOSE_WIDTH, dtype=float).T), 15)


def inside_fissure(local_x: Array) -> Array:
    """True between the canthi."""
    return np.asarray((local_x > CANTHUS_NASAL[0]) & (local_x < CANTHUS_TEMPORAL[0]))


def closure_line(local_x: Array) -> Array:
    """Height of the lower lid's front edge, continued beyond the canthi: where the closed lids meet."""
    y = np.interp(local_x, *_LOWER)
    y = np.where(
        local_x > CANTHUS_TEMPORAL[0], CANTHUS_TEMPORAL[1] - 0.18 * (local_x - CANTHUS_TEMPORAL[0]), y
    )
    return np.asarray(np.where(local_x < CANTHUS_NASAL[0], CANTHUS_NASAL[1], y))


def open_fissure(local_x: Array) -> Array:
    """Visible height of the open fissure at each column, 0 outside; its largest value is OPENING_MM."""
    height = np.maximum(np.interp(local_x, *_FISSURE, left=0.0, right=0.0), 0)
    return np.asarray(height * (OPENING_MM / _FISSURE[1].max()))


def fold_crest(local_x: Array) -> Array:
    """Height of the open upper lid's fold."""
    return np.asarray(np.interp(local_x, *_CREST))


def _sphere(x: Array, y: Array, radius: float, centre_z: float) -> Array:
    """Front of a sphere, continued by its tangent cone so that the height stays finite."""
    r, rim = np.hypot(x, y), 0.965 * radius
    z = np.sqrt(np.maximum(radius**2 - np.minimum(r, rim) ** 2, 0))
    return np.asarray(centre_z + z - np.maximum(r - rim, 0) * rim / np.sqrt(radius**2 - rim**2))


def globe_surface(local_x: Array, y: Array, offset: float) -> Array:
    """Height z of the eyeball with its cornea, grown by `offset` mm: what the lid rests on."""
    globe = _sphere(local_x, y, GLOBE_RADIUS_MM + offset, 0.0)
    cornea = _sphere(local_x, y, CORNEA_RADIUS_MM + offset, CORNEA_CENTRE_Z_MM)
    return smooth_maximum(globe, cornea, 1.2)


def _forehead_and_nose(x: Array, y: Array) -> Array:
    """Paraboloid of the face with brow ridge, glabella and nose; the left brow sits 0.5 mm higher."""
    across = np.abs(x)
    z = 16.5 - 0.0052 * across**2 - 5e-7 * across**4
    ridge = 21.0 - 0.0055 * (across - 30) ** 2 - 0.06 * (across - 30) + 0.5 * step(8, -8, x)
    weight = step(80, 30, across) * (0.45 + 0.55 * step(2, 18, across))
    z = z + 5.0 * bell(y - ridge - 1.5, 8.0) * weight + 1.0 * step(12, 40, y)
    z = z + 2.8 * bell(across, 9) * bell(y - 19, 9)
    width = np.interp(y, _ACROSS_Y, _NOSE_SIGMA)
    off_axis = np.abs(x - 0.35 * bell(y + 8, 12))
    return np.asarray(
        z + np.interp(y, _ACROSS_Y, _NOSE_Z) * np.exp(-(np.abs(off_axis / (1.32 * width)) ** 2.3))
    )


def _orbit_and_cheek(x: Array, y: Array) -> Array:
    """Hollows and swellings round the eye: orbit, sulcus, cheek, tear trough, lower-lid bag."""
    across = np.abs(x)
    local = across - EYE_X_MM
    uneven = 0.12 * step(-20, 20, x)
    r = np.sqrt((local / 20.0) ** 2 + ((y - 3.0) / np.where(y > 3.0, 13.5, 15.0)) ** 2)
    z = -(3.9 - 1.5 * step(-3, 6, y) + 3.2 * step(6, -12, local)) * np.exp(-(r**4) * 0.9)
    z = z - 1.8 * bell(across - 17, 5) * bell(y - 9, 6) - 0.3 * bell(local - 2, 9) * bell(y - 13.5, 3.2)
    z = z + 4.0 * bell(across - 37, 19) * bell(y + 33, 12) + 1.0 * bell(across - 48, 12) * bell(y + 15, 12)
    trough = (y + 8.5 + 0.50 * (across - 16)) / np.hypot(1, 0.50)
    z = z - (1.05 + uneven) * bell(trough, 2.4) * step(9, 15, across) * step(42, 24, across)
    bag = y + 12.6 - 0.016 * (across - 31) ** 2
    return np.asarray(z + (1.08 - uneven) * bell(bag, 3.0) * bell(across - 31, 9))


def _unevenness(x: Array, y: Array) -> Array:
    """No face is smooth at the scale of centimetres, nor the same on both sides."""
    return np.asarray(
        0.16 * np.sin(x * 0.11 + 1.3 + 0.05 * y) * np.cos(y * 0.13 + 0.4)
        + 0.10 * np.sin(x * 0.23 + y * 0.17 + 2.0)
        + 0.07 * np.cos(x * 0.31 - y * 0.29)
        + 0.22 * np.sin(x * 0.045) * np.cos(y * 0.06)
    )


def closed_skin(x: Array, y: Array) -> Array:
    """Height z of the skin with closed eyes, over the whole face."""
    lid = globe_surface(np.abs(x) - EYE_X_MM, y, LID_THICKNESS_MM)
    face = _forehead_and_nose(x, y) + _orbit_and_cheek(x, y)
    return np.asarray(soft_maximum(lid, face, 2.3) - 0.35 + _unevenness(x, y))
