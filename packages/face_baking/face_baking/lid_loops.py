"""Loops of the kit's vertices round each eye: 0 hidden rim, 2 wet edge, 4 lashes, 8 about the fold."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from face_baking.kit import EYEBALLS, Array, FaceKit, Index
from stimuli_builder.characters.colour import smooth

SIDES = (1, -1)
"""1 is the person's left eye (+x), -1 the right one."""
LOOPS = 14
EDGE_LOOP, LASH_LOOP = 2, 4
"""The lid's margin lies between both, about 1 mm as it is seen; with lashes on loop 3 it had no thickness."""

CORNER_SHIFT = (
    (-1.9, -1.3, -0.75, -0.25, 0.0, 0.3, 0.6, 1.0, 1.2),
    (0.0, 0.12, 0.32, 0.54, 0.49, 0.32, 0.15, 0.0, 0.0),
)
"""Way from the corner's old tip toward the temple, and the way of what lies there toward the nose, cm."""
CORNER_NARROWED = ((-1.9, -0.6, -0.2, 0.1, 0.5, 0.9, 1.2), (0.0, 0.0, -0.05, 0.20, 0.15, 0.0, 0.0))
"""Share of its height that the wedge loses, at the same places."""
CORNER_TAPERED = (
    (-1.2, -0.4, -0.1, 0.05, 0.15, 0.3, 0.5, 0.7, 0.9),
    (0.0, 0.0, 0.35, 0.62, 0.56, 0.36, 0.14, 0.0, 0.0),
)
"""Way from the new tip toward the temple, cm, and the share of their height that both lids lose there."""
CORNER_FADES_CM = (0.25, 1.1)
"""Heights from the corner up to which the shift is whole, and from which there is none."""
CORNER_BACK = 0.18
"""Share of the globe's curve that the drawn-out lids follow; the whole of it would sink the corner 3 mm."""


@dataclass(frozen=True, eq=False)
class Globe:
    """An eyeball: center (3,) and radius without the cornea, cm."""

    centre: Array
    radius: float


def lid_loops(kit: FaceKit, side: int) -> list[Index]:
    """The first `LOOPS` loops of vertices from the hidden rim outwards."""
    p = kit.neutral[kit.rim] * np.array([side, 1, 1])
    here = (p[:, 0] > 0.5) & (p[:, 0] < 5) & (p[:, 2] > 8) & (p[:, 1] > 2.5) & (p[:, 1] < 4.7)
    current, seen = kit.rim[here], np.zeros(len(kit.neutral), bool)
    loops = []
    for _ in range(LOOPS):
        seen[current] = True
        loops.append(np.sort(current))
        touching = np.isin(kit.edges, current)
        reached = np.unique(kit.edges[touching.any(axis=1)])
        current = reached[~seen[reached]]
    return loops


def chains(kit: FaceKit, loop: Index, side: int) -> tuple[Index, Index]:
    """Upper and lower half of a loop from nose to temple; both hold the corners."""
    p = kit.neutral[loop]
    x = p[:, 0] * side
    nasal, temporal = p[np.argmin(x)], p[np.argmax(x)]
    line = nasal[1] + (temporal[1] - nasal[1]) * (x - x.min()) / (np.ptp(x) + 1e-9)
    order = np.argsort(x)
    upper = order[p[order, 1] >= line[order] - 1e-6]
    lower = order[p[order, 1] <= line[order] + 1e-6]
    return loop[upper], loop[lower]


def with_longer_corner(kit: FaceKit, rest: Array, loops: list[Index], globe: Globe, side: int) -> Array:
    """A face whose nasal corner is a wedge that ends as far from the iris as people's; the kit's is blunt.

    Skin between the corner and the nose is pressed together, the last third of the lids drawn out.
    """
    upper, _ = chains(kit, loops[EDGE_LOOP], side)
    tip = rest[upper[0]]
    across, height = (rest[:, 0] - tip[0]) * side, rest[:, 1] - tip[1]
    near = (rest[:, 2] > 4) & (np.abs(across) < 2.0) & (np.abs(height) < CORNER_FADES_CM[1])
    shift = np.where(near, PchipInterpolator(*CORNER_SHIFT)(np.clip(across, -1.9, 1.2)), 0.0)
    shift *= smooth(CORNER_FADES_CM[1], CORNER_FADES_CM[0], np.abs(height))
    narrow = np.where(near, PchipInterpolator(*CORNER_NARROWED)(np.clip(across, -1.9, 1.2)), 0.0)
    narrow *= smooth(1.0, 0.35, np.abs(height))
    away = rest - globe.centre
    back = np.clip(away[:, 0] * side / np.maximum(away[:, 2], 0.3), -0.9, 0) * CORNER_BACK
    move = np.stack([-shift * side, -narrow * height, back * shift], -1)
    moved = rest + move
    # The new tip is where the old one went; lids run to a point there.
    way = (moved[:, 0] - moved[upper[0], 0]) * side
    high = moved[:, 1] - moved[upper[0], 1]
    taper = np.where(near, PchipInterpolator(*CORNER_TAPERED)(np.clip(way, -1.2, 0.9)), 0.0)
    moved[:, 1] -= taper * smooth(0.9, 0.25, np.abs(high)) * high
    return np.asarray(moved)


def globe_of(kit: FaceKit, vertices: Array, side: int) -> Globe:
    """The globe of a face: the kit's own, moved and scaled with its vertices."""
    first, last = EYEBALLS[side]
    neutral, here = kit.neutral[first:last], vertices[first:last]
    centre = np.array([3.11645 * side, 3.60158, 7.98230])

    def size(points: Array) -> float:
        return float(np.linalg.norm(points - points.mean(0), axis=1).mean())

    scale = size(here) / size(neutral)
    away = neutral - centre
    distance = np.linalg.norm(away, axis=1)
    angle = np.arccos(np.clip(away[:, 2] / distance, -1, 1))
    radius = float(np.median(distance[(angle > 0.7) & (angle < 1.4)]))
    return Globe(here.mean(0) + (centre - neutral.mean(0)) * scale, radius * scale)
