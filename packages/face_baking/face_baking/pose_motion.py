"""Poses of the lower lid between rendered ones: each point of the skin is taken from where it was rendered.

The mesh says where a point lies in either pose, so that nothing has to be searched for: optical flow loses
lashes that slide by more than their spacing.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from face_baking.framing import Box
from face_baking.lid_pose import LidPose
from face_baking.scene import FaceScene

Light = NDArray[np.float32]
SUPERSAMPLED = 3
_SHIFT = 4
_FRONT_CM = 4.0
_NEAR_PX, _FAR_PX, _EDGE_PX = 1.0, 6.0, 0.7
_INSIDE = 0.3


@dataclass(frozen=True, eq=False)
class PoseMotion:
    """Where what a pose shows lies in another one.

    Attributes
    ----------
    shift : float32 array (h, w, 2)
        Pixels to the right and down from a point of the pose to the same point of the other.
    share : float32 array (h, w, 1)
        How much of a pixel is skin of the lower lid and below: the rest does not move.
    """

    shift: Light
    share: Light

    @classmethod
    def between(cls, scene: FaceScene, pose: LidPose, other: LidPose, box: Box) -> "PoseMotion":
        """Measure it on the scene's mesh; `box` is the part of the frame that is needed."""
        painted = _painted(scene, pose, other, box)
        lower = (painted[..., 2:] > 0.5).astype(np.float32)
        size = box[2], box[3]
        share = cv2.resize(lower, size, interpolation=cv2.INTER_AREA)[..., None]
        shift = cv2.resize(painted[..., :2] * lower, size, interpolation=cv2.INTER_AREA)
        # Lashes are over the lid's edge: what is not skin there follows the skin nearby.
        near, far = (_normalised(shift, share, sigma) for sigma in (_NEAR_PX, _FAR_PX))
        soft = cv2.GaussianBlur(share, (0, 0), _EDGE_PX)[..., None]
        return cls(np.where(share > _INSIDE, near, far).astype(np.float32), soft.astype(np.float32))

    def moved(self, light: Light) -> Light:
        """The pose, made of a picture (h, w, 3) of the other."""
        height, width = light.shape[:2]
        rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
        x, y = columns + self.shift[..., 0], rows + self.shift[..., 1]
        there = cv2.remap(light, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(light + self.share * (there - light), np.float32)


def pose_between(scene: FaceScene, pose: LidPose, ends: dict[LidPose, Light], box: Box) -> Light:
    """(h, w, 3) picture of a pose: the mean of its neighbors, each moved to it, the nearer counting more."""
    far = {end: _distance(pose, end) for end in ends}
    total = sum(far.values())
    mixed = np.zeros((box[3], box[2], 3), np.float32)
    for end, light in ends.items():
        weight = np.float32((1 - far[end] / total) / (len(ends) - 1))
        mixed += weight * PoseMotion.between(scene, pose, end, box).moved(light)
    return mixed


def _distance(a: LidPose, b: LidPose) -> float:
    return float(np.hypot(a.vertical_mm - b.vertical_mm, a.horizontal_mm - b.horizontal_mm))


def _painted(scene: FaceScene, pose: LidPose, other: LidPose, box: Box) -> Light:
    """(3 h, 3 w, 3) of each point's way to the other pose in px, and 1 where it is of the lower lid."""
    skin, at = scene.posed_skin(pose), scene.skin.coordinates
    quads = scene.skin.fine.quads
    here, there = (
        scene.view.project(points) - np.array(box[:2]) for points in (skin, scene.posed_skin(other))
    )
    corners, depth = here[quads], skin[quads, 2].mean(axis=1)
    inside = (corners.max(axis=1) > 0) & (corners.min(axis=1) < np.array(box[2:]))
    seen = np.flatnonzero(inside.all(axis=1) & (depth > _FRONT_CM))
    # Painted from the back to the front, so that what is nearest stays.
    back_first = seen[np.argsort(depth[seen], kind="stable")]
    shift = (there - here)[quads].mean(axis=1)
    lower = at.upper[quads].mean(axis=1) <= 0.5
    fixed = np.round((corners * SUPERSAMPLED - 0.5) * 2**_SHIFT).astype(np.int32)
    image = np.zeros((box[3] * SUPERSAMPLED, box[2] * SUPERSAMPLED, 3), np.float32)
    for number in back_first:
        value = float(shift[number, 0]), float(shift[number, 1]), float(lower[number])
        cv2.fillConvexPoly(image, fixed[number], value, shift=_SHIFT)
    return image


def _normalised(shift: Light, share: Light, sigma: float) -> Light:
    """The shift smoothed over skin alone."""
    weight = cv2.GaussianBlur(share, (0, 0), sigma)[..., None]
    return np.asarray(cv2.GaussianBlur(shift, (0, 0), sigma) / np.maximum(weight, 1e-6), np.float32)
