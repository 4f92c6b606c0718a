"""Lashes that ride on the lids' edges, and brows that lie on the skin, as strands of points in cm."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from face_baking.blink_path import BlinkPath
from face_baking.identity import Hair
from face_baking.kit import Array, Index
from face_baking.lid_loops import LASH_LOOP, SIDES, chains
from face_baking.lid_skin import FaceSkin, normals
from face_baking.sphere import spherical
from stimuli_builder.characters.colour import smooth

LASH_POINTS, BROW_POINTS = 12, 8
CLUMPS = {True: [0.14, 0.28, 0.32, 0.26], False: [0.60, 0.28, 0.09, 0.03]}
"""Shares of clumps of one to four lashes of upper and lower lids: lower ones in even bundles look planted."""
FANNED_UNTIL, DOWN_AT, CLUMPS_APART, RAISED_DEGREES = 0.46, 0.78, 0.16, 10.0
"""Strokes between which upper lashes go down, how far clumps are apart in it, and how far they rise before.

In recordings they stay fanned until the lid is half shut, and then hang before the eye. Turned with their lid
from the start, they lay before it like a comb at closure 0.12; all at once and later, as one dark line.
"""
TEMPLE = (0.80, 1.05)
"""Where along the upper lid its lashes become sparse, and where there would be none.

As many and as long there as elsewhere, seen from the side they were an eyeliner's wing.
"""
_EDGE_POINTS = 200
LEFT_BROW, RIGHT_BROW = slice(22, 27), slice(21, 16, -1)


@dataclass(frozen=True, eq=False)
class Strands:
    """(n, k, 3) points from root to tip and (n,) root radii."""

    points: Array
    radii: Array


def edge_line(path: BlinkPath, vertices: Array, side: int, loop: int, upper: bool) -> Array:
    """(200, 3) points along a lid's edge from nose to temple, evenly spaced at rest; they move with it."""
    chain = chains(path.kit, path.loops[side][loop], side)[0 if upper else 1]
    points = vertices[chain]
    steps = np.linalg.norm(np.diff(path.rest[chain], axis=0), axis=1)
    length = np.concatenate([[0], np.cumsum(steps)])
    at = np.linspace(0, length[-1], _EDGE_POINTS)
    line = np.stack([np.interp(at, length, points[:, k]) for k in range(3)], -1)
    kernel = np.hanning(17) / np.hanning(17).sum()
    padded = np.vstack([np.repeat(line[:1], 8, 0), line, np.repeat(line[-1:], 8, 0)])
    return np.stack([np.convolve(padded[:, k], kernel, "valid") for k in range(3)], -1)


@dataclass(frozen=True, eq=False)
class _LashRow:
    """What is drawn once for a row of lashes; `leader` is the longest lash of each one's clump."""

    along_lid: Array
    size: Array
    fan: Array
    start: Array
    end: Array
    radius: Array
    lift: Array
    leader: Index


class Lashes:
    """One row of lashes of one eye; the same hairs at every closure."""

    def __init__(self, path: BlinkPath, hair: Hair, side: int, upper: bool, seed: int) -> None:
        self.path, self.side, self.upper = path, side, upper
        self.row = _draw_row(hair, upper, np.random.default_rng([seed, side + 5, int(upper)]))

    def at(self, vertices: Array, stroke: float) -> Strands:
        """The strands on the edge of the posed coarse vertices, the lid at a stroke."""
        row, globe = self.row, self.path.globes[self.side]
        line = edge_line(self.path, vertices, self.side, LASH_LOOP, self.upper)
        number = row.along_lid * (len(line) - 1)
        low = np.minimum(number.astype(np.int64), len(line) - 2)
        root = line[low] + (number - low)[:, None] * (line[low + 1] - line[low])
        radial = root - globe.centre
        radial /= np.linalg.norm(radial, axis=1, keepdims=True)
        tangent = np.stack([np.zeros(len(root)), -radial[:, 2], radial[:, 1]], -1) * (1 if self.upper else -1)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        if self.upper:
            radial, tangent = _turned(radial, tangent, self._held_back(root, low, number - low, stroke))
        first = root - 0.03 * radial + row.lift[:, None] * tangent
        points = _grown(first, radial, tangent, row, self.side)
        return Strands(_clumped(points, row.leader), row.radius)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Elevation about the globe of the points of the lid's edge, open and shut, radians."""
        globe = self.path.globes[self.side]
        lines = [
            edge_line(self.path, self.path.at(dict.fromkeys(SIDES, end)), self.side, LASH_LOOP, self.upper)
            for end in (0.0, 1.0)
        ]
        first, last = (spherical(line - globe.centre)[2] for line in lines)
        return first, last

    def _held_back(self, root: Array, low: Index, share: Array, stroke: float) -> Array:
        """Radians by which each lash points higher than its lid has turned it, below 0."""
        opened, shut = (end[low] + share * (end[low + 1] - end[low]) for end in self._ends)
        later = CLUMPS_APART * (np.modf(0.618 * self.row.leader)[0] - 0.5)
        here = spherical(root - self.path.globes[self.side].centre)[2]
        followed = opened + (shut - opened) * smooth(FANNED_UNTIL + later, DOWN_AT + later, stroke)
        raised = np.radians(RAISED_DEGREES) * np.sin(np.pi * np.clip(stroke / 0.992, 0, 1)) ** 2
        return np.asarray(here - followed - raised)


def _turned(radial: Array, tangent: Array, angle: Array) -> tuple[Array, Array]:
    """Both axes of each root turned by its radians toward the tangent, or away from it below 0."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return cos * radial + sin * tangent, cos * tangent - sin * radial


def _grown(first: Array, radial: Array, tangent: Array, row: _LashRow, side: int) -> Array:
    share = np.linspace(0, 1, LASH_POINTS)[None, 1:, None]
    angle = np.radians(row.start[:, None, None] + (row.end - row.start)[:, None, None] * share**0.9)
    along = np.cos(angle) * radial[:, None] + np.sin(angle) * tangent[:, None]
    along = along + np.array([side, 0, 0]) * row.fan[:, None, None] * (0.7 + 0.4 * share)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    steps = np.cumsum(along * (row.size / (LASH_POINTS - 1))[:, None, None], axis=1)
    return np.concatenate([first[:, None], first[:, None] + steps], axis=1)


def _clumped(points: Array, leader: Index) -> Array:
    """Tips drawn toward the longest lash of their clump."""
    reach = np.linalg.norm(points[:, -1] - points[:, 0], axis=1)
    share = np.clip(reach / reach[leader], 0, 1)
    at = np.round(np.linspace(0, 1, LASH_POINTS)[None] * share[:, None] * (LASH_POINTS - 1)).astype(np.int64)
    target = points[leader[:, None], at]
    pull = (np.linspace(0, 1, LASH_POINTS) ** 1.3)[None, :, None] * 0.85
    return np.asarray(points * (1 - pull) + target * pull)


def _draw_row(hair: Hair, upper: bool, rng: np.random.Generator) -> _LashRow:
    along_lid = _roots(round((135 if upper else 105) * hair.lashes), upper, rng)
    count = len(along_lid)
    clump = np.repeat(np.arange(count), rng.choice([1, 2, 3, 4], count, p=CLUMPS[upper]))[:count]
    _, clump = np.unique(clump, return_inverse=True)
    groups = int(clump.max()) + 1 if count else 0
    longer, fanned, curled = (
        rng.normal(1, 0.10, groups),
        rng.normal(0, 0.12 if upper else 0.07, groups),
        rng.normal(1, 0.12, groups),
    )
    centre = np.bincount(clump, along_lid, groups) / np.maximum(np.bincount(clump, minlength=groups), 1)
    middle = (along_lid - 0.5) * 2
    gather = centre[clump] - along_lid
    if upper:
        size = 0.58 + 0.24 * np.exp(-(((along_lid - 0.68) / 0.25) ** 2)) - 0.22 * smooth(0.3, 0.1, along_lid)
        size = size - 0.26 * smooth(TEMPLE[0], 1.0, along_lid)
        size = size * longer[clump] * rng.normal(0.95, 0.14, count)
        fan = (
            0.36 * middle
            + 0.05 * middle * abs(middle)
            + fanned[clump]
            + rng.normal(0, 0.05 + 0.16 * smooth(0.6, 1.0, along_lid), count)
            + gather * 3.0
        )
        start = np.full(count, 30.0)
        end = 30.0 - 64.0 * curled[clump] * rng.normal(1, 0.07, count)
        radius = 0.0074 * rng.normal(1, 0.18, count)
    else:
        size = 0.24 + 0.12 * np.exp(-(((along_lid - 0.62) / 0.3) ** 2))
        size = size * longer[clump] * rng.normal(0.95, 0.26, count)
        fan = 0.40 * middle + fanned[clump] + rng.normal(0, 0.16, count) + gather * 2.0
        start, end = rng.normal(-8.0, 8.0, count), -50.0 * curled[clump] * rng.normal(1, 0.2, count)
        radius = 0.0040 * rng.normal(1, 0.3, count)
    size = np.clip(size, 0.12, 1.2) * hair.lash_length
    leader = np.array(
        [np.flatnonzero(clump == g)[np.argmax(size[clump == g])] for g in range(groups)], np.int64
    )
    lift = rng.uniform(-0.035, 0.03, count) if upper else rng.uniform(-0.045, 0.02, count)
    return _LashRow(along_lid, size, fan, start, end, np.clip(radius, 0.002, None), lift, leader[clump])


def _roots(count: int, upper: bool, rng: np.random.Generator) -> Array:
    """Sorted shares of the lid's length (0 nose, 1 temple) where a row's lashes are, count or fewer."""
    low, high = (0.21, 0.985) if upper else (0.22, 0.97)
    along_lid = np.sort(rng.uniform(low, high, count))
    return along_lid[rng.random(count) < smooth(TEMPLE[1], TEMPLE[0], along_lid)] if upper else along_lid


class Brow:
    """One brow, rooted on the resting skin and moved with it."""

    def __init__(self, skin: FaceSkin, side: int) -> None:
        hair, seed = skin.identity.hair, skin.identity.seed
        landmarks = skin.path.rest[skin.path.kit.landmarks]
        line = landmarks[LEFT_BROW if side > 0 else RIGHT_BROW][:, :2] + np.array([[0, -0.12]])
        self._skin = skin
        self._front = np.flatnonzero(skin.rest[:, 2] > 4)
        self._tree = cKDTree(skin.rest[self._front, :2])
        self._normals = normals(skin.rest, skin.fine.quads)
        self._draw(line, hair, side, np.random.default_rng([seed, side + 5, 9]))

    def at(self, posed: Array) -> Strands:
        """The strands, each moved with its root's skin."""
        moved = posed[self._root] - self._skin.rest[self._root]
        return Strands(self._points + moved[:, None], self._radii)

    def _on_skin(self, xy: Array) -> tuple[Array, Array, Index]:
        """Height, normal and nearest vertex of the resting skin under (n, 2) points."""
        distance, number = self._tree.query(xy, k=4)
        weight = 1 / np.maximum(distance, 1e-6)
        weight /= weight.sum(1, keepdims=True)
        index = self._front[number]
        height = (self._skin.rest[index, 2] * weight).sum(1)
        normal = (self._normals[index] * weight[..., None]).sum(1)
        return height, normal / np.linalg.norm(normal, axis=1, keepdims=True), index[:, 0]

    def _draw(self, line: Array, hair: Hair, side: int, rng: np.random.Generator) -> None:
        n = int(1900 * hair.brow)
        fine = rng.random(n) < 0.6
        along = rng.uniform(-0.06, 1.06, n) + rng.normal(0, 0.03, n)
        # Thin at both ends: hairs grow sparser toward the temple, they do not run together to a point.
        keep = rng.random(n) > np.interp(
            along, [-0.1, 0.0, 0.16, 0.66, 0.85, 1.0, 1.1], [0.97, 0.75, 0, 0, 0.45, 0.85, 0.97]
        )
        fine, along = fine[keep], along[keep]
        n = len(along)
        s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        s /= s[-1]
        half = (
            np.interp(along, [0, 0.1, 0.35, 0.65, 0.88, 1], [0.30, 0.42, 0.44, 0.38, 0.30, 0.24])
            * hair.brow_thickness
        )
        across = np.clip(rng.normal(0.05, np.where(fine, 0.75, 0.55)), -1.7, 1.6)
        beyond = (np.maximum(along - 1, 0) + np.minimum(along, 0)) * side * 3.5
        along_lid = np.stack(
            [np.interp(along, s, line[:, 0]) + beyond, np.interp(along, s, line[:, 1]) + half * across], -1
        )
        lean = np.interp(along, [0, 0.1, 0.3, 0.6, 1], [74, 60, 40, 20, -12])
        lean = (
            lean
            - across * np.interp(along, [0, 0.2, 0.5, 1], [6, 22, 26, 18])
            + rng.normal(0, np.where(fine, 12, 9))
        )
        length = np.interp(along, [0, 0.15, 0.6, 1], [0.42, 0.62, 0.70, 0.44]) * np.where(fine, 0.6, 1)
        length = length * np.clip(rng.normal(0.88, 0.2, n), 0.35, 1.4)
        self._points, self._root = self._laid(
            along_lid, lean, length, rng.normal(26, 9, n), rng.uniform(0.012, 0.045, n), side
        )
        self._radii = np.where(fine, 0.0022, 0.0042) * np.clip(rng.normal(1, 0.35, n), 0.4, 1.9)

    def _laid(
        self, along_lid: Array, lean: Array, length: Array, bend: Array, rise: Array, side: int
    ) -> tuple[Array, Index]:
        """(n, 8, 3) points that follow the skin from their roots, and the roots' vertices."""
        height, normal, root = self._on_skin(along_lid)
        at = np.concatenate([along_lid, height[:, None]], 1)
        points = [at - 0.02 * normal]
        for k in range(1, BROW_POINTS):
            share = k / (BROW_POINTS - 1)
            angle = np.radians(lean - bend * share)
            step = np.stack([side * np.cos(angle), np.sin(angle), np.zeros(len(at))], -1)
            step -= normal * (step * normal).sum(1, keepdims=True)
            step /= np.linalg.norm(step, axis=1, keepdims=True)
            at = at + step * (length / (BROW_POINTS - 1))[:, None]
            height, normal, _ = self._on_skin(at[:, :2])
            at[:, 2] = height
            arch = rise * np.sin(np.pi * min(0.2 + share * 0.7, 1))
            points.append(at + normal * (arch + 0.004)[:, None])
        return np.stack(points, axis=1), root
