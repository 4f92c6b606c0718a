"""Draws the synthetic eyes pixel by pixel: lids sweep a textured eyeball, lashes turn, skin unfolds.

Nothing here is shared with the tracker: no mesh, no piecewise affine warp, no linear model.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: D103

from math import atan2, exp, hypot, pi

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.actor import face as geometry
from stimuli_builder.actor.face import (
    EYE_CENTRES,
    EYE_WIDTH_PX,
    PICTURE_SIZE,
    arch,
    lower_margin,
    upper_margin,
    upper_open,
)
from stimuli_builder.compiled import compiled, compiled_over

# Lengths are in widths of an eye; PIXEL is one of the picture, at the size the actor is drawn.
IRIS_RADIUS = 0.195
PUPIL_SHARE = 0.40
PIXEL = 0.0132
CREASE = 0.085


@compiled
def lookup(texture, row, column):
    """Bilinear sample, edges repeated."""
    # Just inside the last row and column, so that the next ones exist.
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
    # Beyond four widths the bell is below one gray level.
    return exp(-ratio * ratio) if ratio * ratio < 16.0 else 0.0


@compiled
def clamp(value):
    return min(max(value, 0.0), 1.0)


@compiled
def eyeball(u, v, top, low, gaze_u, gaze_v, iris):
    """Gray level of the eyeball behind the opening."""
    # The iris rests a little above the middle of the opening.
    du, dv = u - gaze_u, v + 0.035 - gaze_v
    radius = hypot(du, dv) / IRIS_RADIUS
    # The ball darkens to its edges, most of all to the sides.
    colour = 196.0 - 600.0 * abs(u * u * u) - 440.0 * v * v
    if radius < 1.2:
        angle = (atan2(dv, du) / (2 * pi) + 0.5) * (iris.shape[1] - 1)
        inner = lookup(iris, radius * (iris.shape[0] - 1), angle)
        # An edge one pixel wide instead of a step, for antialiasing.
        inner += (22.0 - inner) * clamp((PUPIL_SHARE - radius) * IRIS_RADIUS / PIXEL + 0.5)
        colour += (inner - colour) * clamp((1.0 - radius) * IRIS_RADIUS / (1.6 * PIXEL) + 0.5)
    # Shadow of the upper lid, and a fainter one above the lower.
    colour *= 1.0 - 0.42 * bell(v - top, 0.055) - 0.10 * bell(low - v, 0.03)
    # The reflection of a lamp follows the gaze by less than half.
    colour += 130.0 * bell(hypot(u - 0.045 - 0.4 * gaze_u, v + 0.075 - 0.4 * gaze_v), 0.022)
    # The moist line along the lower lid.
    return colour + 34.0 * bell(low - v - 0.012, 0.009)


@compiled_over(geometry)
def upper_skin(u, v, top, closure, face_row, face_column, face, lid):
    """Skin above the opening: face above the crease, lid plate that moves with the margin below it."""
    bend = arch(u)
    crease = upper_open(u) - CREASE * (0.35 + 0.65 * bend)
    above = lookup(face, face_row, face_column)
    height = max(top - v, 0.0)
    # Upper lids move a little to the nose when they close.
    nasal = 0.02 * max(closure, 0.0) * bend
    plate = lookup(lid, height / 0.5 * (lid.shape[0] - 1), ((u - nasal) / 1.2 + 0.5) * (lid.shape[1] - 1))
    plate += 26.0 * bend * bell(height - 0.16, 0.13) * max(closure, 0.0)
    # The crease softens as the lid comes down.
    soft = 0.035 + 0.05 * max(closure, 0.0)
    share = clamp((v - crease) / soft + 0.5) * clamp(bend * 4.0)
    colour = above + (plate - above) * share
    colour -= 44.0 * (1.0 - 0.72 * max(closure, 0.0)) * bell(v - crease, 0.017) * clamp(bend * 3.0)
    # The shadow under the margin, where lashes begin.
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
    # While lashes point at the camera they have no length in the picture.
    along = (v - top) / reach if abs(reach) > 0.004 else -1.0
    shade = 1.0
    columns = lashes.shape[1] - 1
    if 0.0 < along < 1.0:
        # Lashes fan out: those at the sides lean outward.
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
            # Antialiased at both margins; where the lids meet the opening fades instead of flickering.
            opening = clamp(min(v - top, low - v) / PIXEL + 0.5) * clamp((low - top) / PIXEL)
            # Beyond the canthi.
            if abs(u) >= 0.5:
                opening = 0.0
            # Within the opening either skin serves, as the ball covers it.
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


# Procedural textures of the synthetic face: skin with brows and nose, lid skin, iris; gray 0 to 255.

Texture = NDArray[np.float32]

MARGIN_PX = 60
LID_SHAPE = (160, 320)
IRIS_SHAPE = (64, 256)


def mottle(shape: tuple[int, int], sizes_px: tuple[float, ...], rng: np.random.Generator) -> Texture:
    """Sum of smooth noises of several grain sizes, unit variance each."""
    total = np.zeros(shape, np.float32)
    for size in sizes_px:
        layer = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), size)
        total += layer / layer.std()
    return total


def face_texture(rng: np.random.Generator) -> Texture:
    """The face at rest without eyes, with a margin of MARGIN_PX on every side."""
    width, height = PICTURE_SIZE[0] + 2 * MARGIN_PX, PICTURE_SIZE[1] + 2 * MARGIN_PX
    # Coordinates of the picture, so that the margin has negative ones.
    y, x = np.mgrid[:height, :width].astype(np.float32) - MARGIN_PX
    base = 158 - 0.00028 * (x - 256) ** 2 + 0.03 * (y - 196)
    base += 2.2 * mottle((height, width), (0.8,), rng) + 3.5 * mottle((height, width), (3.0, 12.0), rng)
    nose = np.exp(-(((x - 256) / 26) ** 2)) * np.clip((y - 130) / 160, 0, 1)
    base += 22 * nose - 16 * np.exp(-(((np.abs(x - 256) - 40) / 16) ** 2)) * np.clip((y - 150) / 120, 0, 1)
    for (cx, cy), side in zip(EYE_CENTRES, (1, -1), strict=True):
        u, v = side * (x - cx) / EYE_WIDTH_PX, (y - cy) / EYE_WIDTH_PX
        base -= 24 * np.exp(-((u / 0.75) ** 2) - ((v + 0.12) / 0.36) ** 2)
        base -= _brow(u, v, rng)
        base -= 9 * np.exp(-(((v - 0.30 - 0.12 * (1 - u * u)) / 0.03) ** 2)) * np.exp(-((u / 0.5) ** 2))
    return _moles(base, rng).astype(np.float32)


def _brow(u: Texture, v: Texture, rng: np.random.Generator) -> Texture:
    spine = -0.62 - 0.08 * np.cos(2.6 * (u + 0.1))
    # Noise of one pixel makes single hairs.
    hairs = mottle((u.shape[0], u.shape[1]), (1.0,), rng) * 0.35 + 1
    shape = np.exp(-(((v - spine) / 0.075) ** 2) - (np.abs(u + 0.02) / 0.62) ** 6)
    return np.asarray(85 * shape * hairs, np.float32)


def _moles(base: Texture, rng: np.random.Generator) -> Texture:
    height, width = base.shape
    for _ in range(45):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        radius, depth = rng.uniform(0.8, 2.4), rng.uniform(6, 26)
        # Nine pixels hold all of a mole of at most 2.4 px.
        x0, x1, y0, y1 = int(max(x - 9, 0)), int(x + 9), int(max(y - 9, 0)), int(y + 9)
        ys, xs = np.mgrid[y0 : min(y1, height), x0 : min(x1, width)]
        base[y0:y1, x0:x1] -= depth * np.exp(-((xs - x) ** 2 + (ys - y) ** 2) / (2 * radius**2))
    return base


def lid_texture(rng: np.random.Generator) -> Texture:
    """Skin of the upper lid's plate: rows from the margin up to 0.5 eye widths, columns u in -0.6 to 0.6."""
    fine = mottle(LID_SHAPE, (2.0,), rng)
    folds = cv2.GaussianBlur(rng.standard_normal(LID_SHAPE).astype(np.float32), (0, 0), sigmaX=24, sigmaY=2.2)
    veins = mottle(LID_SHAPE, (7.0, 16.0), rng)
    return np.asarray(143 + 2.5 * fine + 4.0 * folds / folds.std() + 3.0 * veins, np.float32)


def iris_texture(rng: np.random.Generator) -> Texture:
    """Iris in polar form: rows radius 0 to 1, columns angle."""
    # Three times around, of which the middle is taken: the seam at 360 degrees disappears.
    rays = cv2.GaussianBlur(
        np.tile(rng.standard_normal(IRIS_SHAPE).astype(np.float32), (1, 3)), (0, 0), sigmaX=1.6, sigmaY=9
    )[:, IRIS_SHAPE[1] : 2 * IRIS_SHAPE[1]]
    radius = np.linspace(0, 1, IRIS_SHAPE[0], dtype=np.float32)[:, None]
    ring = np.where(radius > 0.86, 34 * (radius - 0.86) / 0.14, 0) - 14 * np.exp(
        -(((radius - 0.5) / 0.12) ** 2)
    )
    return np.asarray(84 + 11 * rays / rays.std() - ring, np.float32)


def lash_texture(rng: np.random.Generator, columns: int = 512) -> Texture:
    """Darkness of lashes along the margin, two rows: upper and lower lid, u from -0.6 to 0.6."""
    rows = []
    for count, thickness in ((34, 2.0), (26, 1.6)):
        places = np.sort(rng.uniform(0.1, 0.9, count)) * columns
        depth = rng.uniform(0.45, 1.0, count)
        at = np.arange(columns)[:, None]
        # The darkest lash counts where two overlap.
        rows.append((depth * np.exp(-(((at - places) / thickness) ** 2))).max(1))
    return np.asarray(rows, np.float32)
