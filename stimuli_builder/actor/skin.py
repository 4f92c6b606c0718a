"""Procedural textures of the synthetic face: skin with brows and nose, lid skin, iris; grey 0 to 255."""

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.actor.face import EYE_CENTRES, EYE_WIDTH_PX, PICTURE_SIZE

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
    hairs = mottle((u.shape[0], u.shape[1]), (1.0,), rng) * 0.35 + 1
    shape = np.exp(-(((v - spine) / 0.075) ** 2) - (np.abs(u + 0.02) / 0.62) ** 6)
    return np.asarray(85 * shape * hairs, np.float32)


def _moles(base: Texture, rng: np.random.Generator) -> Texture:
    height, width = base.shape
    for _ in range(45):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        radius, depth = rng.uniform(0.8, 2.4), rng.uniform(6, 26)
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
        rows.append((depth * np.exp(-(((at - places) / thickness) ** 2))).max(1))
    return np.asarray(rows, np.float32)
