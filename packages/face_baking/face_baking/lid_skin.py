"""The refined skin of a face at any closure: lids on the globe, folds, and an opening linear in closure."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from face_baking.blink_path import BlinkPath
from face_baking.identity import Identity
from face_baking.kit import RIM_FACES, SKIN_FACES, Array, FaceKit, Index
from face_baking.lid_coordinates import lid_coordinates
from face_baking.lid_loops import SIDES
from face_baking.lid_relief import LidRelief, corner_flesh
from face_baking.subdivision import Subdivision, subdivide

LEAST_CLEARANCE_CM = 0.02
STROKES = 17
LEVELS = 3


def lid_faces(kit: FaceKit, path: BlinkPath, loops: int) -> Index:
    """The kit's faces whose corners all lie on the first `loops` loops of either eye."""
    near = np.concatenate([loop for side in SIDES for loop in path.loops[side][:loops]])
    faces = kit.faces[:RIM_FACES]
    return np.asarray(faces[(np.isin(faces, near) | (faces < 0)).all(axis=1)])


def face_part(kit: FaceKit, low: tuple[float, float, float], high: tuple[float, float, float]) -> Index:
    """The kit's skin faces whose middle in the mean face lies in a box, cm."""
    faces = kit.faces[:SKIN_FACES]
    corners = kit.neutral[np.where(faces >= 0, faces, faces[:, :1])]
    middle = corners.mean(axis=1)
    return np.asarray(faces[((middle > low) & (middle < high)).all(axis=1)])


def normals(points: Array, quads: Index) -> Array:
    """(n, 3) unit normals of a mesh's vertices."""
    a, b, c, d = (points[quads[:, k]] for k in range(4))
    normal = np.cross(c - a, d - b)
    out = np.stack(
        [np.bincount(quads.ravel(), np.repeat(normal[:, k], 4), len(points)) for k in range(3)], -1
    )
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12))


class FaceSkin:
    """The refined skin of part of one face.

    `linear_strokes` of another skin may be given, so that a large part follows the lids' own table.
    """

    def __init__(
        self, path: BlinkPath, identity: Identity, fine: Subdivision, strokes: "LinearStrokes | None" = None
    ) -> None:
        self.path, self.identity, self.fine = path, identity, fine
        self.rest = fine(path.rest)
        self.coordinates = lid_coordinates(path, fine, self.rest)
        self._strokes = strokes

    @cached_property
    def strokes(self) -> "LinearStrokes":
        """Table from closure to the stroke of each lid."""
        return self._strokes or LinearStrokes.measured(self)

    def at(self, closure: float) -> Array:
        """(n, 3) vertices at a closure: the opening at the pupil is (1 - closure) of the open one."""
        return self.at_strokes(self.strokes.of(closure))

    def at_strokes(self, strokes: dict[int, float], lower_cm: tuple[float, float] = (0.0, 0.0)) -> Array:
        """(n, 3) vertices with each side's lid at a stroke, the lower lids moved (up, toward the nose)."""
        posed = self.fine(self.path.at(strokes, lower_cm))
        stroke = np.where(self.coordinates.side > 0, strokes[1], strokes[-1])
        posed = posed + normals(posed, self.fine.quads) * self.relief.displacement(stroke)[:, None]
        return self._outside_the_eye(posed, strokes)

    def _outside_the_eye(self, posed: Array, strokes: dict[int, float]) -> Array:
        loop = self.coordinates.loop
        for side in SIDES:
            near = np.flatnonzero((self.coordinates.side == side) & (loop > 1.2) & (loop < 12))
            gap = self.path.clearance(posed[near], side, strokes[side])
            close = near[gap < LEAST_CLEARANCE_CM]
            away = posed[close] - self.path.globes[side].centre
            missing = (LEAST_CLEARANCE_CM - gap[gap < LEAST_CLEARANCE_CM]) / np.linalg.norm(away, axis=1)
            posed[close] += away * missing[:, None]
        return posed

    @cached_property
    def flat(self) -> Array:
        """(n, 3) vertices with both lids shut, before relief: their skin lies drawn out flat."""
        return self.fine(self.path.at(dict.fromkeys(SIDES, 1.0)))

    @cached_property
    def relief(self) -> LidRelief:
        """What stands out of the skin or goes into it."""
        flesh = corner_flesh(self.path, self.rest)
        return LidRelief(self.coordinates, self.flat, flesh, self.identity)

    def opening(self, posed: Array, side: int, offset_cm: float = 0.0) -> float:
        """Height in cm of what is seen of the eye in a column `offset_cm` from the globe's center.

        The column is a plane through the mesh along the line of sight; skin in front of the globe covers it.
        """
        globe = self.path.globes[side]
        spans = self._section(posed, globe.centre[0] + offset_cm)
        depth2 = globe.radius**2 - offset_cm**2 - (spans[:, 1] - globe.centre[1]) ** 2
        in_front = spans[:, 2] > globe.centre[2] + np.sqrt(np.clip(depth2, 0, None)) - 0.02
        return _uncovered(spans[in_front, :2])

    def _section(self, posed: Array, x: float) -> Array:
        """(m, 3) of the fine faces cut by the plane at x: lowest and highest y, and mean z."""
        corners = posed[self.fine.quads]
        across = corners[..., 0]
        cut = corners[(across.min(1) < x) & (across.max(1) > x)]
        following = np.roll(cut, -1, axis=1)
        dx = following[..., 0] - cut[..., 0]
        share = (x - cut[..., 0]) / np.where(dx == 0, 1, dx)
        crosses = (share >= 0) & (share <= 1) & (dx != 0)
        points = cut + share[..., None] * (following - cut)
        y_low = np.where(crosses, points[..., 1], np.inf).min(1)
        y_high = np.where(crosses, points[..., 1], -np.inf).max(1)
        z = np.where(crosses, points[..., 2], 0).sum(1) / np.maximum(crosses.sum(1), 1)
        return np.stack([y_low, y_high, z], -1)


@dataclass(frozen=True, eq=False)
class LinearStrokes:
    """For each side the strokes at which the opening falls evenly, and the open eyes' openings in cm."""

    tables: dict[int, PchipInterpolator]
    open_cm: dict[int, float]

    def of(self, closure: float) -> dict[int, float]:
        """Stroke of each side at a closure (0-1); exactly 0 and 1 at the ends."""
        if closure in (0.0, 1.0):
            return dict.fromkeys(SIDES, closure)
        return {side: float(np.clip(table(closure), 0, 1)) for side, table in self.tables.items()}

    @classmethod
    def measured(cls, skin: FaceSkin) -> "LinearStrokes":
        """Measure the opening at `STROKES` strokes and turn the table round."""
        at = np.linspace(0, 1, STROKES)
        openings = np.array(
            [
                [skin.opening(posed, side) for side in SIDES]
                for posed in (skin.at_strokes({1: t, -1: t}) for t in at)
            ]
        )
        tables, opened = {}, {}
        for k, side in enumerate(SIDES):
            closure = np.maximum.accumulate(1 - openings[:, k] / openings[0, k])
            # Once the edges have met the lid only settles: that part of the stroke belongs to closure 1.
            met = int(np.argmax(closure >= 0.9995)) if (closure >= 0.9995).any() else STROKES - 1
            rising = np.concatenate([[True], np.diff(closure[: met + 1]) > 1e-9])
            known = np.flatnonzero(rising)
            ends = closure[known].copy()
            ends[-1] = max(ends[-1], 1.0) if met == known[-1] else ends[-1]
            tables[side] = PchipInterpolator(ends, at[known], extrapolate=True)
            opened[side] = float(openings[0, k])
        return cls(tables, opened)


def lid_skin(path: BlinkPath, identity: Identity, loops: int = 10, levels: int = LEVELS) -> FaceSkin:
    """The lids alone: enough to measure the opening by and to learn the strokes from."""
    return FaceSkin(path, identity, subdivide(lid_faces(path.kit, path, loops), levels))


def _uncovered(spans: Array) -> float:
    """Length between the lowest and highest of (m, 2) intervals that none of them covers."""
    order = spans[np.argsort(spans[:, 0])]
    reached = np.maximum.accumulate(order[:, 1])
    return float(np.clip(order[1:, 0] - reached[:-1], 0, None).sum())
