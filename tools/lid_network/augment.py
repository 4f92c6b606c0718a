"""What a camera and a face may do to an eye that was cut out: training pictures, drawn anew each time."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
Grey = NDArray[np.float32]

SIZE = (96, 64)
"""Width and height of the network's picture."""
EYE_PX = 56.0
"""Width of an eye in it when the region is right."""
SOURCE_EYE_PX = 96.0
EYES_SEEN_PX = (25.0, 120.0)
"""Widths of the eye in the recording whose resolution is put on."""


@dataclass(frozen=True)
class Example:
    """A grey picture (64, 96), lids (2, 11, 2) and iris (x, y, radius) in its pixels."""

    picture: Grey
    lids: Values
    iris: Values


def example(
    picture: NDArray[np.uint8], lids: Values, iris: Values, visible: float, rng: np.random.Generator
) -> Example:
    """One picture as it may be seen: moved, bent, lit, covered, blurred and compressed."""
    matrix = _placement(rng)
    bend = rng.normal(0, 0.0022, 2)
    grey = _bent(_mixed(picture, rng), matrix, bend)
    points = _taken(np.concatenate([lids.reshape(-1, 2), iris[None, :2]]), matrix, bend)
    radius = iris[2] * np.sqrt(abs(np.linalg.det(matrix[:, :2])))
    new_lids, new_iris = points[:-1].reshape(lids.shape), np.array([*points[-1], radius])
    if rng.random() < 0.5:
        grey = grey[:, ::-1].copy()
        new_lids[..., 0] = SIZE[0] - 1 - new_lids[..., 0]
        new_lids, new_iris[0] = new_lids[:, ::-1], SIZE[0] - 1 - new_iris[0]
    if visible > 0.05:
        grey = _other_eye(grey, new_lids, new_iris, rng)
    grey = _lashes(grey, new_lids, rng)
    return Example(_photographed(_covered(_lit(grey, rng), new_lids, rng), rng), new_lids, new_iris)


def _placement(rng: np.random.Generator) -> Values:
    """(2, 3) matrix from the cut-out to the picture: a region never fits quite."""
    scale = EYE_PX / SOURCE_EYE_PX * np.exp(rng.normal(0, 0.16))
    turn, shear = np.radians(rng.normal(0, 8)), rng.normal(0, 0.06)
    tall = np.exp(rng.normal(0, 0.14))
    a = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    a = scale * a @ np.array([[1, shear], [0, tall]])
    middle = (np.array([192, 160]) - 1) / 2
    centre = (np.array(SIZE) - 1) / 2 + rng.normal(0, 1, 2) * [6, 4]
    return np.column_stack([a, centre - a @ middle])


def _offset(points: Values, bend: Values) -> Values:
    """How far the bend moves points (..., 2) of the picture, in px: parabolas."""
    x = points[..., 0] - (SIZE[0] - 1) / 2
    y = points[..., 1] - (SIZE[1] - 1) / 2
    return np.stack([bend[1] * y * y, bend[0] * x * x], -1)


def _bent(grey: Grey, matrix: Values, bend: Values) -> Grey:
    inverse = cv2.invertAffineTransform(matrix)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float64)
    at = np.stack([x, y], -1)
    source = (at + _offset(at, bend)) @ inverse[:, :2].T + inverse[:, 2]
    source = source.astype(np.float32)
    bent = cv2.remap(
        grey, source[..., 0], source[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101
    )
    return np.asarray(bent, np.float32)


def _taken(points: Values, matrix: Values, bend: Values) -> Values:
    """Points of the cut-out in the picture: the bend is undone by iteration, it is small."""
    straight: Values = points @ matrix[:, :2].T + matrix[:, 2]
    at = straight
    for _ in range(4):
        at = straight - _offset(at, bend)
    return at


def _mixed(picture: NDArray[np.uint8], rng: np.random.Generator) -> Grey:
    """Grey of a colour picture, from mostly red (as in infrared, where skin is bright) to mostly blue."""
    weights = rng.dirichlet([1.6, 1.2, 0.5])
    return np.asarray(cv2.transform(picture.astype(np.float32), weights[None].astype(np.float32)), np.float32)


def _other_eye(grey: Grey, lids: Values, iris: Values, rng: np.random.Generator) -> Grey:
    """Another iris, pupil and reflections of lamps within the opening; the white may be darker."""
    opening = np.zeros(grey.shape, np.uint8)
    outline = np.concatenate([lids[0], lids[1][::-1]])
    cv2.fillPoly(opening, [np.round(outline * 16).astype(np.int32)], 255, cv2.LINE_AA, 4)
    share = opening.astype(np.float32) / 255
    x, y, radius = iris
    ys, xs = np.mgrid[: grey.shape[0], : grey.shape[1]]
    away = np.hypot(xs - x, ys - y)
    if rng.random() < 0.5:
        disc = share * np.clip(radius - away + 0.5, 0, 1)
        level = rng.uniform(30, 190)
        grey = np.asarray(grey + disc * rng.uniform(0.3, 1) * (level - grey), np.float32)
    if rng.random() < 0.6:
        pupil = share * np.clip(radius * rng.uniform(0.22, 0.62) - away + 0.5, 0, 1)
        filling = rng.uniform(0, 50) if rng.random() < 0.9 else 210.0 - grey
        grey = np.asarray(grey + pupil * filling - pupil * grey * 0.9, np.float32)
    if rng.random() < 0.4:
        grey = np.asarray(grey * (1 - share * rng.uniform(0, 0.45)), np.float32)
    for _ in range(rng.integers(0, 4)):
        gx, gy = x + rng.normal(0, 0.6) * radius, y + rng.normal(0, 0.6) * radius
        spot = np.exp(-(((xs - gx) ** 2 + (ys - gy) ** 2) / (2 * rng.uniform(0.5, 1.8) ** 2)))
        grey = (grey + share * spot * (255 - grey)).astype(np.float32)
    return grey.astype(np.float32)


def _lashes(grey: Grey, lids: Values, rng: np.random.Generator) -> Grey:
    """More lashes, on either lid, hanging down the more the eye is shut."""
    if rng.random() < 0.35:
        return grey
    layer = np.zeros(grey.shape, np.uint8)
    gap = np.abs(lids[0, 5, 1] - lids[1, 5, 1]) / EYE_PX
    for lid, sign in ((0, -1.0 if gap > 0.18 or rng.random() < 0.3 else 1.0), (1, 1.0)):
        length = rng.uniform(2, 9) * (1.0 if lid == 0 else 0.6)
        for _ in range(rng.integers(0, 26)):
            at = rng.uniform(0.8, 9.2)
            low = int(at)
            root = lids[lid, low] + (at - low) * (lids[lid, low + 1] - lids[lid, low])
            aside = (at - 5) * rng.uniform(0.2, 1.0) + rng.normal(0, 0.8)
            tip = root + np.array([aside, sign * length * rng.uniform(0.5, 1.1)])
            ends = np.round(np.stack([root, tip]) * 16).astype(np.int32)
            cv2.line(layer, ends[0], ends[1], int(rng.uniform(60, 220)), 1, cv2.LINE_AA, 4)
    share = cv2.GaussianBlur(layer, (3, 3), 0.5).astype(np.float32) / 255
    return np.asarray(grey + share * (rng.uniform(10, 60) - grey), np.float32)


def _lit(grey: Grey, rng: np.random.Generator) -> Grey:
    """Light from a side, folds and shadows of skin, then the camera's curve."""
    height, width = grey.shape
    if rng.random() < 0.6:
        coarse = rng.normal(0, 1, (rng.integers(2, 6), rng.integers(2, 8))).astype(np.float32)
        grey = grey * np.exp(
            rng.uniform(0.03, 0.3) * cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        )
    if rng.random() < 0.5:
        fine = rng.normal(0, 1, (height, width)).astype(np.float32)
        fine = cv2.GaussianBlur(fine, (0, 0), rng.uniform(0.7, 4), sigmaY=rng.uniform(0.7, 2))
        grey = grey * (1 + rng.uniform(0.01, 0.1) * fine / fine.std())
    low, high = np.percentile(grey, [1, 99])
    unit = np.clip((grey - low) / max(high - low, 1.0), 0, 1.2)
    return np.asarray(unit ** np.exp(rng.normal(0, 0.35)), np.float32)


def _covered(unit: Grey, lids: Values, rng: np.random.Generator) -> Grey:
    """Rims, a mirroring lens, hair or a finger over a part of the eye."""
    height, width = unit.shape
    if rng.random() < 0.12:
        points = rng.uniform([-20, -10], [width + 20, height + 10], (3, 2))
        t = np.linspace(0, 1, 20)[:, None]
        curve = (1 - t) ** 2 * points[0] + 2 * t * (1 - t) * points[1] + t**2 * points[2]
        line = np.zeros(unit.shape, np.uint8)
        cv2.polylines(
            line, [np.round(curve * 16).astype(np.int32)], False, 255, int(rng.integers(1, 6)), cv2.LINE_AA, 4
        )
        unit = unit + line.astype(np.float32) / 255 * (rng.uniform(0, 1) - unit)
    if rng.random() < 0.2:
        ys, xs = np.mgrid[:height, :width]
        x, y = lids.reshape(-1, 2).mean(0) + rng.normal(0, 14, 2)
        turn = rng.uniform(0, np.pi)
        u, v = (
            (xs - x) * np.cos(turn) + (ys - y) * np.sin(turn),
            (ys - y) * np.cos(turn) - (xs - x) * np.sin(turn),
        )
        glare = 1 / (
            1
            + np.exp(
                4
                * ((np.abs(u) / rng.uniform(4, 30)) ** 2 + (np.abs(v) / rng.uniform(3, 12)) ** 2 - 1).clip(
                    -8, 8
                )
            )
        )
        unit = unit + rng.uniform(0.1, 0.7) * glare.astype(np.float32)
    if rng.random() < 0.08:
        x, y = rng.integers(0, width), rng.integers(0, height)
        unit = unit.copy()
        unit[y : y + rng.integers(4, 24), x : x + rng.integers(4, 34)] = rng.uniform(0, 1)
    return unit.astype(np.float32)


def _photographed(unit: Grey, rng: np.random.Generator) -> Grey:
    """The resolution of the recording, motion, noise, compression; then spread to mean 0, sd 1."""
    height, width = unit.shape
    seen = np.exp(rng.uniform(*np.log(EYES_SEEN_PX)))
    if rng.random() < 0.15:
        kernel = np.zeros((7, 7), np.float32)
        kernel[3, 3] = 1
        kernel[3 - rng.integers(0, 4) : 4 + rng.integers(0, 4), 3] = 1
        unit = cv2.filter2D(unit, -1, kernel / kernel.sum())
    if rng.random() < 0.4:
        unit = cv2.GaussianBlur(unit, (0, 0), rng.uniform(0.3, 1.8))
    size = max(24, round(width * min(seen / EYE_PX, 1.0))), max(16, round(height * min(seen / EYE_PX, 1.0)))
    small = cv2.resize(unit, size, interpolation=cv2.INTER_AREA)
    level = small * rng.uniform(60, 235) + rng.uniform(0, 45)
    level = level + rng.normal(0, rng.uniform(0, 9), level.shape)
    byte = np.clip(np.rint(level), 0, 255).astype(np.uint8)
    if rng.random() < 0.6:
        _, packed = cv2.imencode(".jpg", byte, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 96))])
        byte = cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE)
    return normalised(cv2.resize(byte, (width, height), interpolation=cv2.INTER_LINEAR))


def normalised(grey: NDArray[np.uint8]) -> Grey:
    """Mean 0, standard deviation 1."""
    levels = grey.astype(np.float32)
    return np.asarray((levels - levels.mean()) / max(float(levels.std()), 4.0), np.float32)
