"""Draws the synthetic eyes pixel by pixel: lids sweep a textured eyeball, lashes turn, skin unfolds.

Nothing here is shared with the tracker: no mesh, no piecewise affine warp, no linear model.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: D103

from math import atan2, exp, hypot, pi

import numpy as np

from stimuli_builder.actor import face as geometry
from stimuli_builder.actor.face import arch, lower_margin, upper_margin, upper_open
from stimuli_builder.compiled import compiled, compiled_over

IRIS_RADIUS = 0.195
PUPIL_SHARE = 0.40
PIXEL = 0.0132
CREASE = 0.085


@compiled
def lookup(texture, row, column):
    """Bilinear sample, edges repeated."""
    row = min(max(row, 0.0), texture.shape[0] - 1.001)
    column = min(max(column, 0.0), texture.shape[1] - 1.001)
    r, c = int(row), int(column)
    fr, fc = row - r, column - c
    top = texture[r, c] + fc * (texture[r, c + 1] - texture[r, c])
    low = texture[r + 1, c] + fc * (texture[r + 1, c + 1] - texture[r + 1, c])
    return top + fr * (low - top)


@compiled
def bell(distance, width):
    ratio = distance / width
    return exp(-ratio * ratio) if ratio * ratio < 16.0 else 0.0


@compiled
def clamp(value):
    return min(max(value, 0.0), 1.0)


@compiled
def eyeball(u, v, top, low, gaze_u, gaze_v, iris):
    """Grey level of the eyeball behind the opening."""
    du, dv = u - gaze_u, v + 0.035 - gaze_v
    radius = hypot(du, dv) / IRIS_RADIUS
    colour = 196.0 - 600.0 * abs(u * u * u) - 440.0 * v * v
    if radius < 1.2:
        angle = (atan2(dv, du) / (2 * pi) + 0.5) * (iris.shape[1] - 1)
        inner = lookup(iris, radius * (iris.shape[0] - 1), angle)
        inner += (22.0 - inner) * clamp((PUPIL_SHARE - radius) * IRIS_RADIUS / PIXEL + 0.5)
        colour += (inner - colour) * clamp((1.0 - radius) * IRIS_RADIUS / (1.6 * PIXEL) + 0.5)
    colour *= 1.0 - 0.42 * bell(v - top, 0.055) - 0.10 * bell(low - v, 0.03)
    colour += 130.0 * bell(hypot(u - 0.045 - 0.4 * gaze_u, v + 0.075 - 0.4 * gaze_v), 0.022)
    return colour + 34.0 * bell(low - v - 0.012, 0.009)


@compiled_over(geometry)
def upper_skin(u, v, top, closure, face_row, face_column, face, lid):
    """Skin above the opening: face above the crease, lid plate that moves with the margin below it."""
    bend = arch(u)
    crease = upper_open(u) - CREASE * (0.35 + 0.65 * bend)
    above = lookup(face, face_row, face_column)
    height = max(top - v, 0.0)
    nasal = 0.02 * max(closure, 0.0) * bend
    plate = lookup(lid, height / 0.5 * (lid.shape[0] - 1), ((u - nasal) / 1.2 + 0.5) * (lid.shape[1] - 1))
    plate += 26.0 * bend * bell(height - 0.16, 0.13) * max(closure, 0.0)
    soft = 0.035 + 0.05 * max(closure, 0.0)
    share = clamp((v - crease) / soft + 0.5) * clamp(bend * 4.0)
    colour = above + (plate - above) * share
    colour -= 44.0 * (1.0 - 0.72 * max(closure, 0.0)) * bell(v - crease, 0.017) * clamp(bend * 3.0)
    return colour - 78.0 * bell(height, 0.016) * clamp(bend * 12.0)


@compiled_over(geometry)
def lower_skin(u, v, low, closure, to_row, to_column, side, scale, face):
    """Skin below the opening, carried to the nose and up with the lower lid, less so further down."""
    shut = max(closure, 0.0)
    depth = max(v - low, 0.0)
    near = arch(u) * exp(-depth / 0.22) * shut
    row = to_row + 0.025 * near * scale
    column = to_column - side * 0.08 * near * scale
    colour = lookup(face, row, column)
    rim = clamp(arch(u) * 3.0)
    return colour + rim * (17.0 * bell(depth - 0.012, 0.011) - 26.0 * bell(depth - 0.034, 0.012))


@compiled_over(geometry)
def lash_shade(u, v, top, low, closure, lashes):
    """Share of light that lashes leave; the upper ones point up when open and down when closed."""
    bend = arch(u)
    if bend <= 0.0:
        return 1.0
    shut = max(closure, 0.0)
    reach = (-0.085 + 0.215 * shut) * (0.4 + 0.6 * bend)
    along = (v - top) / reach if abs(reach) > 0.004 else -1.0
    shade = 1.0
    columns = lashes.shape[1] - 1
    if 0.0 < along < 1.0:
        root = u - 0.02 * shut * bend + 0.10 * u * along * abs(reach) / 0.1
        dark = lookup(lashes, 0.0, (root / 1.2 + 0.5) * columns)
        shade -= 0.72 * dark * (1.0 - along * along) * clamp(bend * 4.0)
    below = (v - low) / 0.055
    if 0.0 < below < 1.0:
        root = u - 0.08 * shut * bend + 0.05 * u * below
        shade *= 1.0 - 0.34 * lookup(lashes, 1.0, (root / 1.2 + 0.5) * columns) * (1.0 - below)
    return shade


@compiled_over(geometry)
def draw_eye(
    out,
    cover,
    x0,
    y0,
    inverse,
    centre,
    side,
    width,
    closure,
    gaze,
    light,
    face,
    margin,
    lid,
    iris,
    lashes,
    share,
):
    """Add one exposure of one eye, weighted by `share`, into out and cover (h, w) float32.

    The patch starts at picture pixel (x0, y0); `inverse` (2, 3) leads from the picture to the face at rest.
    """
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            px, py = column + x0, row + y0
            rest_x = inverse[0, 0] * px + inverse[0, 1] * py + inverse[0, 2]
            rest_y = inverse[1, 0] * px + inverse[1, 1] * py + inverse[1, 2]
            u = side * (rest_x - centre[0]) / width
            v = (rest_y - centre[1]) / width
            top, low = upper_margin(u, closure), lower_margin(u, closure)
            opening = clamp(min(v - top, low - v) / PIXEL + 0.5) * clamp((low - top) / PIXEL)
            if abs(u) >= 0.5:
                opening = 0.0
            if v < top or (v < 0.5 * (top + low)):
                colour = upper_skin(u, v, top, closure, rest_y + margin, rest_x + margin, face, lid)
            else:
                colour = lower_skin(u, v, low, closure, rest_y + margin, rest_x + margin, side, width, face)
            if opening > 0.0:
                ball = eyeball(u, v, top, low, gaze[0] * side, gaze[1], iris)
                colour += (ball - colour) * opening
            colour *= lash_shade(u, v, top, low, closure, lashes)
            out[row, column] += np.float32(share * light * colour)
            cover[row, column] += np.float32(share * opening)
