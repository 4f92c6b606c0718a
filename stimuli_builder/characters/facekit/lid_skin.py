"""The refined skin of a face at any closure: lids on the globe, folds, and an opening linear in closure."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from stimuli_builder.characters.facekit.blink_path import BlinkPath, corner_line
from stimuli_builder.characters.facekit.field_noise import value_noise
from stimuli_builder.characters.facekit.identity import Identity
from stimuli_builder.characters.facekit.kit import RIM_FACES, SKIN_FACES, Array, FaceKit, Index
from stimuli_builder.characters.facekit.lid_loops import LOOPS, SIDES
from stimuli_builder.characters.facekit.sphere import smooth, spherical
from stimuli_builder.characters.facekit.subdivision import Subdivision, subdivide

LEAST_CLEARANCE_CM = 0.02
LID_MIDDLE = 0.15
"""Azimuth half way along the lids, radians."""
STROKES = 17
LEVELS = 3


@dataclass(frozen=True, eq=False)
class LidCoordinates:
    """Where each fine vertex lies on the lids.

    Attributes
    ----------
    loop : float64 array (n,)
        Loop of vertices, continued between the loops; 14 beyond the last.
    upper : float64 array (n,)
        1 above the line through the eye's corners, 0 below.
    azimuth : float64 array (n,)
        About the globe of its side, towards the temple, radians.
    side : float64 array (n,)
        1 on the person's left, -1 on the right.
    """

    loop: Array
    upper: Array
    azimuth: Array
    side: Array


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
        self.coordinates = _coordinates(path, fine, self.rest)
        self._strokes = strokes

    @cached_property
    def strokes(self) -> "LinearStrokes":
        """Table from closure to the stroke of each lid."""
        return self._strokes or LinearStrokes.measured(self)

    def at(self, closure: float) -> Array:
        """(n, 3) vertices at a closure: the opening at the pupil is (1 - closure) of the open one."""
        return self.at_strokes(self.strokes.of(closure))

    def at_strokes(self, strokes: dict[int, float], lower_cm: tuple[float, float] = (0.0, 0.0)) -> Array:
        """(n, 3) vertices with each side's lid at a stroke, the lower lids moved (up, towards the nose)."""
        posed = self.fine(self.path.at(strokes, lower_cm))
        stroke = np.where(self.coordinates.side > 0, strokes[1], strokes[-1])
        posed = posed + normals(posed, self.fine.quads) * self._relief(stroke)[:, None]
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
    def _waves(self) -> tuple[Array, Array, Array]:
        """Noise along the lid (which bends the fold), across it (fine lines) and of the skin's surface."""
        at, seed = self.coordinates, self.identity.seed
        zero = np.zeros_like(at.loop)
        along = np.stack([at.azimuth * 2.2, at.side * 3, zero], -1)
        lines = np.stack([at.azimuth * 3.0 + 11 * at.side, at.loop * 1.9, zero], -1)
        return (
            0.35 * value_noise(along, seed + 5, 2),
            value_noise(lines, seed + 8, 3),
            value_noise(self.flat * 4.5, seed + 30, 3),
        )

    def _relief(self, stroke: Array) -> Array:
        """Displacement along the normal in cm: the open lid's fold, its remnants, and lines when shut."""
        at, lids = self.coordinates, self.identity.lids
        wander, lines, surface = self._waves
        years = age_depth(self.identity.skin.age)
        envelope = smooth(-0.85, -0.35, at.azimuth) * smooth(1.25, 0.75, at.azimuth) * at.upper
        height = lids.crease + wander * 0.6
        height = height - 0.9 * smooth(0.1, -0.8, at.azimuth) - 0.5 * smooth(0.5, 1.2, at.azimuth)
        above, opened = at.loop - height, 1 - stroke
        # Of one depth from end to end it was a line drawn round the eye: it runs out, and is nowhere gone.
        uneven = np.clip(0.85 + 0.9 * wander - 0.35 * np.abs(at.azimuth - LID_MIDDLE), 0.35, 1.1)
        fold = -lids.depth * uneven * (0.022 + 0.030 * opened) * np.exp(-((above / 0.48) ** 2))
        fold += lids.depth * 0.030 * opened * np.exp(-(((above - 1.15) / 0.8) ** 2))
        second = np.exp(-(((above - 1.5) / 0.22) ** 2)) * (0.4 + 0.6 * stroke)
        fold -= 0.012 * years * second * np.clip(0.5 + 1.2 * wander, 0, 1)
        furrows = np.exp(-((lines / 0.22) ** 2)) * smooth(3.6, 5.0, at.loop) * smooth(11.5, 8.5, at.loop)
        fold -= 0.006 * years * furrows
        below = (1 - at.upper) * smooth(-0.9, -0.5, at.azimuth) * smooth(1.2, 0.8, at.azimuth)
        bag = 0.010 * years * np.exp(-(((at.loop - 5.2) / 1.0) ** 2))
        bag -= 0.016 * np.exp(-(((at.loop - 7.6 - 0.8 * wander) / 0.55) ** 2))
        bag -= 0.004 * (years - 0.4) * np.exp(-((lines / 0.25) ** 2)) * smooth(4.0, 6.0, at.loop)
        grain = 0.0020 * surface * smooth(3.5, 6.0, at.loop)
        return np.asarray(fold * envelope + bag * below + grain)

    def opening(self, posed: Array, side: int, offset_cm: float = 0.0) -> float:
        """Height in cm of what is seen of the eye in a column `offset_cm` from the globe's centre.

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


def age_depth(age: float) -> float:
    """Depth of lines and furrows relative to 35 years."""
    return float(np.clip(0.35 + 0.65 * (age - 18) / 17, 0.3, 2.2))


def lid_skin(path: BlinkPath, identity: Identity, loops: int = 10, levels: int = LEVELS) -> FaceSkin:
    """The lids alone: enough to measure the opening by and to learn the strokes from."""
    return FaceSkin(path, identity, subdivide(lid_faces(path.kit, path, loops), levels))


def _coordinates(path: BlinkPath, fine: Subdivision, rest: Array) -> LidCoordinates:
    number = np.full(len(path.rest), float(LOOPS))
    for side in SIDES:
        for k, loop in enumerate(path.loops[side]):
            number[loop] = k
    sides = np.where(rest[:, 0] >= 0, 1.0, -1.0)
    upper, azimuth = np.zeros(len(rest)), np.zeros(len(rest))
    for side in SIDES:
        here = (sides == side) & (rest[:, 2] > 4)
        _, turned, elevation = spherical(rest[here] - path.globes[side].centre)
        nasal, height, slope, _ = corner_line(path, side)
        azimuth[here] = turned * side
        upper[here] = smooth(-0.03, 0.05, elevation - (height + slope * (turned * side - nasal)))
    return LidCoordinates(fine(number), upper, azimuth, sides)


def _uncovered(spans: Array) -> float:
    """Length between the lowest and highest of (m, 2) intervals that none of them covers."""
    order = spans[np.argsort(spans[:, 0])]
    reached = np.maximum.accumulate(order[:, 1])
    return float(np.clip(order[1:, 0] - reached[:-1], 0, None).sum())
