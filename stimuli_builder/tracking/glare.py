"""Highlights over the lids, such as reflections on glasses: where they lie, lids are not seen.

Detector and model draw open lids around a highlight on shut ones, and the residual is as usual, since the one
trained the other. A highlight shows in the skin around the lids: that skin lies in the brow's
shade, and under a highlight it is brighter than the cheek. The white of an eye may be brighter than the cheek
too, but it lies between the lids, next to a dark iris.
"""

import math

import numpy as np
from numpy.typing import NDArray

from stimuli_builder.compiled import compiled, compiled_over
from stimuli_builder.tracking import shapes
from stimuli_builder.tracking.fit import Fit
from stimuli_builder.tracking.model import CoupledModel
from stimuli_builder.tracking.shapes import CANTHI, EYE_POINTS, Points
from stimuli_builder.video import Picture

Values = NDArray[np.float64]

BRIGHTER = 1.16
"""Least gray level of a highlight, in medians of the cheek: hardly any skin around lids is as bright."""
SATURATED, OVER_SKIN = 230.0, 1.03
"""Gray level that is a highlight on bright skin, if it is brighter than the skin at all: many videos end at a
luma of 235."""
LEAST_SHARE = 0.02
"""Part of lids and skin around them below which a highlight is one on the cornea, and hides no lid."""
LEAST_OUTSIDE, WIDE_OUTSIDE = 0.03, 0.07
"""Parts of the skin around the lids: a highlight covers the first at least; one that covers the second hides
half-open lids whatever lies between them. Glints of an infrared lamp next to an eye cover up to 0.06."""
DARK_IRIS, NO_IRIS = 0.45, 0.62
"""A quarter of the pixels between open lids is darker than this part of the skin, since an iris is among them
(0.2 to 0.4 of it without a highlight, 0.4 to 0.6 under a weak one); shut lids under a highlight have 0.6."""
BETWEEN = 0.18
"""Part of the pixels between half-open lids that are not the shaded white of the eye, but a highlight."""
SHUT, OPEN = 0.1, 0.7
"""Openings, in the widest labeled ones, between which lids under a highlight are not believed: a wide open
eye shows its iris, one seen shut its lashes, but shut lids under a highlight are seen half open."""
HIDDEN = 0.3
"""Stated error, in eye's widths, of lids around which all is a highlight; a part of it for a part."""
GLARE = "glare over {}: lids under a highlight cannot be detected"
EYE_NAMES = {1: ("the eye",), 2: ("the left eye", "the right eye")}
COLUMNS, ROWS = 21, 14
HALF_WIDE, TOP, BOTTOM = 0.5, -0.35, 0.3
"""The grid about the lids, in eye's widths from the middle of the canthi."""
SKIN_COLUMNS, SKIN_ROWS = 13, 5
SKIN_HALF_WIDE, SKIN_TOP, SKIN_BOTTOM = 0.6, 0.4, 0.8
OUTSIDE, INSIDE, CORNER = 0.05, 0.03, 0.4
"""How far from the lids a pixel counts as outside and inside; and how far from the middle as no corner."""
LEAST_INSIDE = 6
UPPER_CURVE, LOWER_CURVE = (0, 1, 2, 3, 4, 5), (5, 6, 7, 8, 0)


class GlareCheck:
    """Finds highlights over the lids of fits of one model."""

    def __init__(self, model: CoupledModel):
        self._model = model
        count = EYE_POINTS * model.eyes
        labelled = model.mesh.vertices + np.tensordot(model.examples, model.shape_modes, axes=1)
        openings = np.array([opening_shares(shape[:count]) for shape in labelled])
        # Not the widest: one frame of surprise would make every usual opening look half shut.
        self._usual = np.maximum(np.percentile(openings, 90, axis=0), 1e-3)

    def of(self, fit: Fit, picture: Picture) -> tuple[Values, str]:
        """How far highlights hide the lids of each eye, and why lids are not believed.

        Parameters
        ----------
        picture : uint8 array (h, w)
            Gray, reduced as the fit's.

        Returns
        -------
        float64 array (eyes,)
            What is to be added to the stated error in quadrature, in eye's widths.
        str
            Over which eye glare lies, or empty.
        """
        hidden, names = np.zeros(self._model.eyes), []
        for eye in range(self._model.eyes):
            points = fit.vertices[EYE_POINTS * eye : EYE_POINTS * (eye + 1)].astype(np.float64)
            share, outside, inside, quarter, opening = highlights(picture, points)
            wide = opening / float(self._usual[eye])
            # A quartile of 0 means that hardly anything lies between the lids: it says nothing of an iris.
            dark = 0 < quarter <= DARK_IRIS
            # Whites may outshine dark skin, next to a dark iris: that is not a highlight.
            seen = outside >= LEAST_OUTSIDE or (inside >= BETWEEN and not dark)
            if not seen or share < LEAST_SHARE:
                continue
            # A highlight that hides nothing for sure still makes the lids less certain, as far as it covers
            # them.
            hidden[eye] = HIDDEN * share
            half_open = SHUT < wide < OPEN and (outside >= WIDE_OUTSIDE or not dark)
            no_iris = wide >= SHUT and quarter > NO_IRIS
            if half_open or no_iris:
                names.append(EYE_NAMES[self._model.eyes][eye])
        return hidden, GLARE.format(" and ".join(names)) if names else ""


def opening_shares(points: Points) -> Values:
    """Mean opening about the middle of each eye, as part of its width, of (9 * eyes, 2) points."""
    eyes = np.ascontiguousarray(points, np.float64).reshape(-1, EYE_POINTS, 2)
    return np.array([opening_share(*across_eye(eye)) for eye in eyes])


@compiled_over(shapes)
def across_eye(eye: Points) -> tuple[Values, Values]:
    """Places (9,) of an eye's points along its canthi from their middle and square to them, in its widths."""
    first, last = eye[CANTHI[0]], eye[CANTHI[1]]
    dx, dy = last[0] - first[0], last[1] - first[1]
    # Image-left to image-right, whichever order the points have: `down` then points down in both eyes.
    if dx < 0:
        dx, dy = -dx, -dy
    width = max(math.hypot(dx, dy), 1e-6)
    x, y = eye[:, 0] - (first[0] + last[0]) / 2, eye[:, 1] - (first[1] + last[1]) / 2
    return (x * dx + y * dy) / width**2, (y * dx - x * dy) / width**2


@compiled
def lid_at(u: float, along: Values, down: Values, curve: tuple[int, ...]) -> float:
    """How far down a lid's curve is at `u` along the canthi; 0 beyond them."""
    for n in range(len(curve) - 1):
        a, b = along[curve[n]], along[curve[n + 1]]
        # Two points of a lid may lie at one place along the canthi, with no slope between them.
        if min(a, b) <= u <= max(a, b) and a != b:
            return float(down[curve[n]] + (u - a) / (b - a) * (down[curve[n + 1]] - down[curve[n]]))
    return 0.0


@compiled
def opening_share(along: Values, down: Values) -> float:
    """Mean opening at seven places about the middle."""
    total = 0.0
    for n in range(7):
        u = 0.05 * (n - 3)
        total += lid_at(u, along, down, LOWER_CURVE) - lid_at(u, along, down, UPPER_CURVE)
    return total / 7


@compiled
def level_at(picture: Picture, x: float, y: float) -> float:
    """Gray level between four pixels; the nearest ones beyond the picture."""
    height, width = picture.shape
    # Just inside the last row and column, so that the pixels below and to the right exist.
    x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
    left, top = int(x), int(y)
    right_share, lower_share = x - left, y - top
    upper = (1 - right_share) * picture[top, left] + right_share * picture[top, left + 1]
    lower = (1 - right_share) * picture[top + 1, left] + right_share * picture[top + 1, left + 1]
    return float((1 - lower_share) * upper + lower_share * lower)


@compiled_over(shapes)
def highlights(picture: Picture, eye: Points) -> tuple[float, float, float, float, float]:
    """Look for highlights about the lids of an eye.

    Parameters
    ----------
    picture : uint8 array (h, w)
        Gray.
    eye : float64 array (9, 2)
        In its pixels.

    Returns
    -------
    tuple of float
        Parts that a highlight covers: of all around the lids, of the skin outside them, and between them (0
        where hardly anything lies there); the lower quartile of the levels between them as part of the skin's
        median (0 likewise); and the opening as part of the eye's width.
    """
    along, down = across_eye(eye)
    first, last = eye[CANTHI[0]], eye[CANTHI[1]]
    if last[0] < first[0]:
        first, last = last, first
    ax, ay = last[0] - first[0], last[1] - first[1]
    mx, my = (first[0] + last[0]) / 2, (first[1] + last[1]) / 2
    skin = np.empty(SKIN_COLUMNS * SKIN_ROWS)
    for row in range(SKIN_ROWS):
        v = SKIN_TOP + (SKIN_BOTTOM - SKIN_TOP) * row / (SKIN_ROWS - 1)
        for column in range(SKIN_COLUMNS):
            u = SKIN_HALF_WIDE * (2 * column / (SKIN_COLUMNS - 1) - 1)
            skin[row * SKIN_COLUMNS + column] = level_at(picture, mx + u * ax - v * ay, my + u * ay + v * ax)
    skin.sort()
    # The median, so that a highlight may reach down to the cheek.
    usual = skin[len(skin) // 2]
    # On bright skin BRIGHTER times the cheek would lie above what a picture can hold.
    limit = min(BRIGHTER * usual, max(SATURATED, OVER_SKIN * usual))
    inside = np.empty(COLUMNS * ROWS)
    covered, outside, covered_outside, between, covered_between = 0, 0, 0, 0, 0
    for column in range(COLUMNS):
        u = HALF_WIDE * (2 * column / (COLUMNS - 1) - 1)
        upper, lower = lid_at(u, along, down, UPPER_CURVE), lid_at(u, along, down, LOWER_CURVE)
        for row in range(ROWS):
            v = TOP + (BOTTOM - TOP) * row / (ROWS - 1)
            level = level_at(picture, mx + u * ax - v * ay, my + u * ay + v * ax)
            highlight = level > limit
            covered += highlight
            if v < upper - OUTSIDE or v > lower + OUTSIDE:
                outside += 1
                covered_outside += highlight
            elif abs(u) < CORNER and upper + INSIDE < v < lower - INSIDE:
                inside[between] = level
                between += 1
                covered_between += highlight
    quarter, share_between = 0.0, 0.0
    if between >= LEAST_INSIDE:
        levels = inside[:between].copy()
        levels.sort()
        quarter, share_between = levels[between // 4] / max(usual, 1.0), covered_between / between
    share = covered / (COLUMNS * ROWS)
    return share, covered_outside / max(outside, 1), share_between, quarter, opening_share(along, down)
