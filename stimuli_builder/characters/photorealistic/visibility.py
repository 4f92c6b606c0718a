"""What each pixel of an eye's box shows (eyeball, lid, lash) and where that was in other poses.

The skin's vertices are splatted on the pixel grid, nearest to the camera on top: no renderer is needed.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stimuli_builder.characters.photorealistic.curves import Array
from stimuli_builder.characters.photorealistic.eyelid_skin import SkinMesh
from stimuli_builder.characters.photorealistic.framing import Box, Frame
from stimuli_builder.characters.photorealistic.hair import Strand, lashes
from stimuli_builder.characters.photorealistic.parameters import Face

EYE, UPPER_LID, LOWER_LID, UPPER_LASH, LOWER_LASH = 0, 1, 2, 3, 4
ELSEWHERE = 255
_SPLITS = 3


@dataclass(frozen=True)
class Surface:
    """(n, 3) points in mm that correspond from pose to pose, and (n,) what each belongs to."""

    points: Array
    kind: NDArray[np.uint8]


def surface(face: Face, skin: SkinMesh, side: int) -> Surface:
    """Skin and lashes of one side of the face (-1 or 1) as dense points."""
    points, kind = _dense_skin(skin, side)
    upper, lower = lashes(skin.edges, side, face.hair, face.seed + 3 + side)
    parts, kinds = [points], [kind]
    for strands, one in ((upper, UPPER_LASH), (lower, LOWER_LASH)):
        parts.append(_dense_strands(strands))
        kinds.append(np.full(len(parts[-1]), one, np.uint8))
    return Surface(np.concatenate(parts), np.concatenate(kinds))


def _dense_skin(skin: SkinMesh, side: int) -> tuple[Array, NDArray[np.uint8]]:
    """Bilinear points in every quad that can border or cover the eye, so that splats leave no holes."""
    corners = skin.vertices[skin.quads]
    middle = skin.uv[skin.quads].mean(1)
    u, v = (middle[:, 0] - 0.5) * 160 * side - 30, (middle[:, 1] - 0.5) * 100
    near = (np.abs(u) < 17) & (v > -12) & (v < 4)
    corners, upper = corners[near], skin.upper[skin.quads[near, 2]]
    share = (np.arange(_SPLITS) + 0.5) / _SPLITS
    parts = []
    for a in share:
        for b in share:
            weights = np.array([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b])
            parts.append(np.einsum("k,nkd->nd", weights, corners))
    kind = np.where(upper > 0.5, UPPER_LID, LOWER_LID).astype(np.uint8)
    return np.concatenate(parts), np.tile(kind, len(parts))


def _dense_strands(strands: list[Strand], splits: int = 5) -> Array:
    if not strands:
        return np.empty((0, 3))
    points = np.stack([strand[0] for strand in strands])
    share = (np.arange(splits) / splits)[:, None]
    filled = points[:, :-1, None] * (1 - share) + points[:, 1:, None] * share
    return np.asarray(filled.reshape(-1, 3))


@dataclass(frozen=True)
class View:
    """(h, w) kind at each pixel of a box and (h, w) index of the surface point seen there (-1: the eye)."""

    kind: NDArray[np.uint8]
    point: NDArray[np.int64]


def view(seen: Surface, frame: Frame, box: Box) -> View:
    """Splat a surface on a box's pixels; what stays empty between the lids is the eye."""
    x, y, width, height = box
    at = np.floor(frame.project(seen.points) - (x, y)).astype(int)
    inside = (at[:, 0] >= 0) & (at[:, 0] < width) & (at[:, 1] >= 0) & (at[:, 1] < height)
    index = np.flatnonzero(inside)
    index = index[np.argsort(seen.points[index, 2], kind="stable")]
    point = np.full((height, width), -1, np.int64)
    point[at[index, 1], at[index, 0]] = index
    point = _close_holes(point)
    kind = np.where(point >= 0, seen.kind[np.maximum(point, 0)], ELSEWHERE)
    rows = np.arange(height)[:, None]
    upper, lower = (
        np.where(kind == UPPER_LID, rows, -1).max(0),
        np.where(kind == LOWER_LID, rows, height).min(0),
    )
    between = (rows > upper) & (rows < lower) & (upper >= 0) & (lower < height)
    # Slits narrower than three pixels are the ragged end of the splatted patch, not the eye.
    empty = ((point < 0) & between).astype(np.uint8)
    eye = cv2.morphologyEx(empty, cv2.MORPH_OPEN, np.ones((1, 3), np.uint8)) > 0
    kind = np.where(eye, EYE, kind).astype(np.uint8)
    return View(kind, point)


def _close_holes(point: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give an empty pixel its left neighbour's point where left and right (or above and below) are filled."""
    padded = np.pad(point, 1, constant_values=-1)
    left, right, above, below = padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]
    empty = point < 0
    filled = np.where(empty & (left >= 0) & (right >= 0), left, point)
    return np.asarray(np.where(empty & (filled < 0) & (above >= 0) & (below >= 0), above, filled))


def upper_lid_matte(face: Face, skin: SkinMesh, frame: Frame, side: int, box: Box) -> NDArray[np.float32]:
    """(h, w) share of each pixel of a box covered by upper lid or upper lashes: splats at triple size."""
    fine = Frame(frame.width_px * 3, frame.height_px * 3)
    x, y, width, height = box
    seen = surface(face, skin, side)
    kind = view(seen, fine, (3 * x, 3 * y, 3 * width, 3 * height)).kind
    lash = cv2.dilate((kind == UPPER_LASH).astype(np.uint8), np.ones((1, 2), np.uint8))
    covered = np.maximum(lash, kind == UPPER_LID).astype(np.float32)
    return np.asarray(cv2.resize(covered, (width, height), interpolation=cv2.INTER_AREA), np.float32)
