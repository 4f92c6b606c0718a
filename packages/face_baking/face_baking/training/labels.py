"""Where lids, canthi and iris of a posed face are in the picture, read off the geometry that is rendered."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from face_baking.kit import Array, Index
from face_baking.lid_loops import EDGE_LOOP, chains
from face_baking.scene import SIDE_NAMES
from face_baking.sphere import IRIS_CM
from face_baking.training.draw import SamplePose
from face_baking.training.scene import SampleScene

CURVE_POINTS, OUTLINE_POINTS = 25, 32
Covered = NDArray[np.uint8]
_RINGS, _SECTORS = 12, 48
_SUPERSAMPLED, _SHIFT = 4, 4
_BEHIND_CM = 0.3
_RIM_LOOP = 1.2


def labels_of(scene: SampleScene, pose: SamplePose) -> dict[str, Any]:
    """Labels of both eyes by the person's side; pixels from the upper left corner, pixel 0 spanning 0 to 1.

    Each eye has `upper` and `lower` (25 points along the edge of the lid that touches the eye, from nose to
    temple), `nasal` and `temporal` canthus, `iris` (`centre`, `outline` of the limbus, `visible`: share of
    its disc that neither lids, nose nor the frame's border hide) and `opening_px`, `closure`.
    The cornea's refraction moves what is seen of the iris; labels are of the iris itself.
    """
    scene.express(pose)
    strokes = scene.strokes_of(pose)
    posed = scene.turn(scene.posed_skin(pose), pose)
    covered = _covered(scene, posed)
    eyes = {}
    for side, name in SIDE_NAMES.items():
        upper, lower = (_curve(scene, posed, side, row) for row in (0, 1))
        middle = slice(CURVE_POINTS // 3, -(CURVE_POINTS // 3))
        gap = np.linalg.norm(upper[middle] - lower[middle], axis=1).max()
        eyes[name] = {
            "closure": pose.closure if side > 0 else pose.closure_right,
            "upper": _rounded(upper),
            "lower": _rounded(lower),
            "nasal": _rounded((upper[0] + lower[0]) / 2),
            "temporal": _rounded((upper[-1] + lower[-1]) / 2),
            "opening_px": round(float(gap), 2),
            "iris": _iris(scene, pose, side, strokes[side], covered),
        }
    return {"eyes": eyes}


def _curve(scene: SampleScene, posed: Array, side: int, row: int) -> Array:
    """(25, 2) points along one lid's edge: the refined mesh's own vertices, evenly spaced along them."""
    path, used = scene.path, scene.skin.fine.used
    chain = chains(path.kit, path.loops[side][EDGE_LOOP], side)[row]
    at = scene.view.project(posed[np.searchsorted(used, chain)])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    even = np.linspace(0, length[-1], CURVE_POINTS)
    return np.stack([np.interp(even, length, at[:, k]) for k in range(2)], -1)


def _iris(scene: SampleScene, pose: SamplePose, side: int, stroke: float, covered: Covered) -> dict[str, Any]:
    globe, ahead = scene.path.globes[side], scene.path.gaze(side, stroke)
    right = np.cross([0, 1.0, 0], ahead)
    right /= np.linalg.norm(right)
    up = np.cross(ahead, right)
    centre = globe.centre + ahead * np.sqrt(globe.radius**2 - IRIS_CM**2)

    def disc(radius: Array, angle: Array) -> Array:
        offset = np.cos(angle)[..., None] * right + np.sin(angle)[..., None] * up
        return scene.view.project(scene.turn(centre + radius[..., None] * offset, pose))

    angle = np.linspace(0, 2 * np.pi, OUTLINE_POINTS, endpoint=False)
    radius = IRIS_CM * np.sqrt((np.arange(_RINGS) + 0.5) / _RINGS)
    rings = np.meshgrid(radius, np.linspace(0, 2 * np.pi, _SECTORS, endpoint=False), indexing="ij")
    return {
        "centre": _rounded(scene.view.project(scene.turn(centre, pose))),
        "outline": _rounded(disc(np.full(OUTLINE_POINTS, IRIS_CM), angle)),
        "visible": round(_share_seen(disc(*rings).reshape(-1, 2), covered), 3),
    }


def _share_seen(points: Array, covered: Covered) -> float:
    """Share of points, equal in area, that lie in the frame and under no skin."""
    at = np.floor(points * _SUPERSAMPLED).astype(np.int64)
    inside = np.flatnonzero(((at >= 0) & (at < [covered.shape[1], covered.shape[0]])).all(axis=1))
    open_to_view = covered[at[inside, 1], at[inside, 0]] == 0
    return float(np.count_nonzero(open_to_view) / len(points))


def _covered(scene: SampleScene, posed: Array) -> Covered:
    """(4 h, 4 w) picture that is 255 where skin lies before the irises' planes."""
    width, height = scene.view.size_px
    image = np.zeros((height * _SUPERSAMPLED, width * _SUPERSAMPLED), np.uint8)
    quads, loop = scene.skin.fine.quads, scene.skin.coordinates.loop
    front = min(globe.centre[2] for globe in scene.path.globes.values())
    near: Index = quads[(posed[quads, 2].min(1) > front - _BEHIND_CM) & (loop[quads].min(1) > _RIM_LOOP)]
    at = scene.view.project(posed) * _SUPERSAMPLED - 0.5
    corners = np.round(at * 2**_SHIFT).astype(np.int32)[near]
    limit = np.array([image.shape[1], image.shape[0]]) << _SHIFT
    shown = ((corners.max(1) > 0) & (corners.min(1) < limit)).all(1)
    for quad in corners[shown]:
        cv2.fillConvexPoly(image, quad, 255, shift=_SHIFT)
    return image


def _rounded(points: Array) -> list[Any]:
    rounded: list[Any] = np.round(points, 2).tolist()
    return rounded
