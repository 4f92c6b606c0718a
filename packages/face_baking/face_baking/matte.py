"""Where upper lid and upper lashes hide the lower lid, drawn from the geometry instead of rendered."""

import cv2
import numpy as np
from numpy.typing import NDArray

from face_baking.framing import Box
from face_baking.hair import Strands
from face_baking.lid_pose import LidPose
from face_baking.scene import FaceScene

MATTE_CLOSURES = tuple(k / 32 for k in range(33))
SUPERSAMPLED = 4
_SHIFT = 4
_LASH_COVERS = 0.75


def upper_lid_matte(scene: FaceScene, pose: LidPose, box: Box) -> NDArray[np.uint8]:
    """(h, w) code values of a box: 255 where the upper lid or its lashes are in front, 0 elsewhere."""
    parts = scene.shapes(pose)
    image = np.zeros((box[3] * SUPERSAMPLED, box[2] * SUPERSAMPLED), np.uint8)
    skin, at = parts[0].arrays()["vertices"].astype(np.float64), scene.skin.coordinates
    quads = scene.skin.fine.quads
    corners = _pixels(scene, skin, box)[quads]
    seen = _touching(corners, image.shape) & (skin[quads, 2].mean(1) > 4)
    upper = at.upper[quads].mean(1) > 0.5
    # Painted from the back to the front, so that what is nearest stays.
    back_first = np.flatnonzero(seen)[np.argsort(skin[quads[seen], 2].mean(1), kind="stable")]
    for number in back_first:
        colour = 255 if upper[number] else 0
        cv2.fillConvexPoly(image, corners[number], colour, shift=_SHIFT)
    for part in parts:
        if part.name.startswith("upper_lashes") and isinstance(part.shape, Strands):
            lines = _pixels(scene, part.shape.points, box)
            colour = round(255 * _LASH_COVERS)
            covered = np.zeros_like(image)
            cv2.polylines(covered, list(lines), False, colour, thickness=3, shift=_SHIFT)
            image = np.maximum(image, covered)
    return np.asarray(cv2.resize(image, (box[2], box[3]), interpolation=cv2.INTER_AREA), np.uint8)


def _pixels(scene: FaceScene, points: NDArray[np.float64], box: Box) -> NDArray[np.int32]:
    """Fixed-point places in the supersampled box of (..., 3) points."""
    at = (scene.view.project(points) - np.array(box[:2])) * SUPERSAMPLED - 0.5
    return np.asarray(np.round(at * 2**_SHIFT), np.int32)


def _touching(corners: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    low, high = corners.min(1), corners.max(1)
    size = np.array([shape[1], shape[0]]) << _SHIFT
    return np.asarray(((high > 0) & (low < size)).all(1))
