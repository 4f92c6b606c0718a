"""The blink's path: each lid vertex travels on a sphere about its globe's center, and its edges meet.

The kit's eyeBlink is linear: halfway it cuts through the globe, and shut its edges do not meet. Here its end
position is corrected until they meet, the way there is a great circle, and what comes too near the eye is
lifted off. A stroke of 0 is open and 1 shut; `lid_skin.py` finds the stroke of a closure.
"""

import numpy as np
from scipy.interpolate import RBFInterpolator

from face_baking.identity import Movement
from face_baking.kit import Array, FaceKit, Index
from face_baking.lid_loops import EDGE_LOOP, SIDES, chains, globe_of, lid_loops, with_longer_corner
from face_baking.lower_lid import lower_lid_weight, moved_lower_lid, turned_about
from face_baking.sphere import IRIS_CM, cartesian, slerp, spherical, surface_radius
from stimuli_builder.characters.colour import smooth

CAMERA_Z_CM = 74.0
IRIS_COVERED_CM, IRIS_COVERED_BELOW_CM = 0.25, 0.01
"""How far the resting lids' wet edges reach over the iris; 0.7 mm less of it is seen covered (see
docs/explanation/face-quality.md), since an iris fades into the white at its rim and a lid is thick."""
ENDS_FIRST, ENDS_AWAY = 1.0, (0.10, 0.75)
"""How early the lid's ends go before its middle, 0.15 of their way at a third of the stroke, and from and to
which azimuth. Without it the edge of a half-shut lid was a straight line; people's is an arch."""
SIDE_TAGS = {1: "L", -1: "R"}
# Gap between the shut edges, least distances of the loops from the eye, and the softness of the lift, cm.
_OVERLAP_CM, _CLEARANCE_CM, _SOFT_CM = -0.004, (0.005, 0.035, 0.075), 0.012
_OUTER_CLEARANCE_CM = 0.11
_NEAR_CM, _REACH_CM = 3.4, 1.0
# The kit's blink pulls faintly at brow and cheek; what is declared to hold still does.
_WHOLE_CM, _STILL_CM = 1.9, 2.5
# The shut corner by the nose is shallow: how far behind the skin round it the loops may lie, cm, and how far
# from the corner that holds.
_CORNER_DEPTHS_CM = (0.16, 0.10, 0.05, 0.03, 0.02, 0.015, 0.015, 0.015, 0.015)
_CORNER_UNDER_CM, _CORNER_SOFT_CM, _CORNER_WHOLE_CM, _CORNER_END_CM = 0.09, 0.01, 0.55, 1.1


class BlinkPath:
    """One face's vertices at any stroke of either lid.

    Attributes
    ----------
    rest : float64 array (26719, 3)
        The face with open eyes.
    globes : dict
        Each eye's globe by side.
    loops : dict
        Each eye's loops of vertices by side.
    look : tuple
        Degrees that both eyes look to the person's left and up, besides what moves with the lid.
    expression : float64 array (26719, 3) or 0
        Displacement of a face that does not rest, cm; added at every stroke.
    """

    def __init__(self, kit: FaceKit, rest: Array, movement: Movement) -> None:
        self.kit, self.movement = kit, movement
        self.look, self.expression = (0.0, 0.0), np.zeros((1, 3))
        self.globes = {side: globe_of(kit, rest, side) for side in SIDES}
        self.loops = {side: lid_loops(kit, side) for side in SIDES}
        self.rest = rest.copy()
        for side in SIDES:
            self.rest = with_longer_corner(kit, self.rest, self.loops[side], self.globes[side], side)
        for side in SIDES:
            self.rest = self._lids_on_iris(side)
        self._others = {side: self._other_movement(side) for side in SIDES}
        self._blink = {side: self._declared_blink(side) for side in SIDES}
        self._moved = {side: np.abs(self._blink[side]).max(1) > 1e-5 for side in SIDES}
        self._lower_lids = {side: self._lower_lid(side) for side in SIDES}
        self._shut = {side: self._shut_about_globe(side) for side in SIDES}

    def _lower_lid(self, side: int) -> tuple[Index, Array]:
        """Vertices round an eye, and the share of the lower lid's movement that each follows."""
        near, lower, _ = self._lid_halves(side)
        return near, lower

    def _lid_halves(self, side: int) -> tuple[Index, Array, Array]:
        """Vertices round an eye, and the share of the movement of its lower and its upper lid for each."""
        loops = self.loops[side]
        near = np.concatenate(loops)
        loop = np.repeat(np.arange(len(loops), dtype=np.float64), [len(one) for one in loops])
        nasal, height, slope, length = corner_line(self, side)
        _, azimuth, elevation = spherical(self.rest[near] - self.globes[side].centre)
        turned = azimuth * side - nasal
        below = smooth(0.02, -0.04, elevation - (height + slope * turned))
        lower, upper = (lower_lid_weight(loop, half, turned / length) for half in (below, 1 - below))
        return near, lower, upper

    def _lids_on_iris(self, side: int) -> Array:
        """The resting face with both lids at the iris: the upper one over its rim, the lower one at it.

        The kit's own lids lie anywhere from 1.3 to 2.7 mm over the rim, and left white below some irises.
        """
        globe, out = self.globes[side], self.rest.copy()
        upper, lower = (
            self.rest[chain] - globe.centre for chain in chains(self.kit, self.loops[side][EDGE_LOOP], side)
        )
        at = np.zeros(1)
        down = IRIS_CM - IRIS_COVERED_CM - float(_profile(at, upper[:, 0], upper[:, 1])[0])
        up = IRIS_COVERED_BELOW_CM - IRIS_CM - float(_profile(at, lower[:, 0], lower[:, 1])[0])
        near, of_lower, of_upper = self._lid_halves(side)
        out[near] = moved_lower_lid(out[near], of_lower, globe, side, up, 0.0)
        out[near] = moved_lower_lid(out[near], of_upper, globe, side, down, 0.0)
        return out

    def _other_movement(self, side: int) -> Array:
        weights = {"cheekSquint": self.movement.cheek, "eyeSquint": self.movement.squint}
        weights["browDown"] = self.movement.brow
        shapes = self.kit.expressions
        return np.asarray(sum(w * shapes[f"{name}_{SIDE_TAGS[side]}"] for name, w in weights.items()))

    def gaze(self, side: int, stroke: float) -> Array:
        """(3,) unit gaze direction: at the camera, and down and in as far as declared with the lid."""
        x, _, z = self.globes[side].centre
        yaw = np.arctan2(-x, CAMERA_Z_CM - z) - side * np.radians(self.movement.gaze_in_degrees) * stroke
        pitch = -np.radians(self.movement.gaze_down_degrees) * stroke
        yaw, pitch = yaw + np.radians(self.look[0]), pitch + np.radians(self.look[1])
        return np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])

    def clearance(self, points: Array, side: int, stroke: float) -> Array:
        """(n,) distance of points outside the eye's surface, cm; below 0 inside it."""
        globe = self.globes[side]
        away = points - globe.centre
        radius = np.linalg.norm(away, axis=-1)
        angle = np.arccos(np.clip(away @ self.gaze(side, stroke) / np.maximum(radius, 1e-9), -1, 1))
        return np.asarray(radius - surface_radius(angle, globe.radius))

    def at(self, strokes: dict[int, float], lower_cm: tuple[float, float] = (0.0, 0.0)) -> Array:
        """(26719, 3) vertices with each side's lid at its stroke, the lower lids moved up and nasally."""
        out = self.rest + sum(strokes[side] * self._others[side] for side in SIDES)
        for side in SIDES:
            out[self._moved[side]] = self._along(side, strokes[side])
        out = out + self.expression
        for side in SIDES:
            if any(lower_cm):
                out = self._lower_lid_moved(out, side, *lower_cm)
            out = self._off_the_eye(out, side, strokes[side])
        return np.asarray(out)

    def _lower_lid_moved(self, vertices: Array, side: int, up_cm: float, nasal_cm: float) -> Array:
        """The lower lid moved on the globe; where it would pass the upper lid's edge it stops there."""
        near, weight = self._lower_lids[side]
        globe, out, edge_weight = self.globes[side], vertices.copy(), np.zeros(len(vertices))
        upper, lower = chains(self.kit, self.loops[side][3], side)
        edge_weight[near] = weight
        out[near] = moved_lower_lid(vertices[near], weight, globe, side, up_cm, nasal_cm)
        # Heights in the picture, since the upper lid's edge lies before the lower one's.
        edge, height = out[lower, 0], out[lower, 1]
        ceiling = _profile(edge, vertices[upper, 0], vertices[upper, 1])
        # Shut edges overlap a little: there the lid may stay as high as it was.
        ceiling = np.maximum(ceiling, _profile(edge, vertices[lower, 0], vertices[lower, 1]))
        at, passed = out[near, 0], np.clip(height - ceiling, 0, None)
        if not passed.any():
            return out
        share = np.clip(weight / np.maximum(_profile(at, edge, edge_weight[lower]), 0.1), 0, 1)
        angle = share * _profile(at, edge, passed) / globe.radius
        return turned_about(out, near, globe, -angle)

    def _along(self, side: int, whole: float) -> Array:
        """Where a side's moved vertices are: on great circles near the globe, else straight."""
        globe, moved = self.globes[side], self._moved[side]
        start, end = (self.rest - globe.centre)[moved], self._shut[side][moved]
        r0, r1 = np.linalg.norm(start, axis=1), np.linalg.norm(end, axis=1)
        away = np.abs(np.arctan2(start[:, 0], np.maximum(start[:, 2], 0.1)))
        stroke = whole + ENDS_FIRST * whole * (1 - whole) ** 2 * smooth(*ENDS_AWAY, away)
        radius = r0 + stroke * (r1 - r0)
        round_way = slerp(start / r0[:, None], end / r1[:, None], stroke) * radius[:, None]
        near = np.clip((_NEAR_CM - r0) / _REACH_CM, 0, 1)[:, None]
        straight = start + stroke[:, None] * (end - start)
        return np.asarray(globe.centre + straight * (1 - near) + round_way * near)

    def _shut_about_globe(self, side: int) -> Array:
        """Shut position relative to the globe's center: the kit's, corrected so that the edges meet."""
        globe = self.globes[side]
        base = self.rest + self._others[side] - globe.centre
        points = base + self._blink[side]
        for _ in range(3):
            points = self._edges_together(points, base, side)
        return self._corner_filled(points, side)

    def _corner_filled(self, points: Array, side: int) -> Array:
        """Bring the pocket of the nasal corner forward to a smooth skin laid over what surrounds it.

        The kit's corner is a pocket 2 mm deep, right for an open eye; between shut lids it is a dark pit.
        """
        loops = self.loops[side]
        across = points[:, 0] * side
        across = across - across[loops[3]].min()
        upper = np.concatenate([chains(self.kit, loops[k], side)[0] for k in range(4, 9)])
        lower = np.concatenate([chains(self.kit, loops[k], side)[1] for k in (7, 8)])
        round_it = [*loops[9:13], upper[across[upper] > 0.25], lower[across[lower] > 0.35]]
        anchors = np.unique(np.concatenate(round_it))
        anchors = anchors[across[anchors] < _CORNER_END_CM + 0.3]
        skin = RBFInterpolator(points[anchors, :2], points[anchors, 2], smoothing=1e-3)
        edge_upper = chains(self.kit, loops[3], side)[0]
        for index, depth in zip(loops, _CORNER_DEPTHS_CM, strict=False):
            near = index[across[index] < _CORNER_END_CM]
            # What of the lower lid has slipped under the upper one stays there.
            edge = _profile(across[near], across[edge_upper], points[edge_upper, 1])
            under = np.isin(near, chains(self.kit, index, side)[1][1:]) * smooth(
                -0.03, 0.02, points[near, 1] - edge
            )
            missing = skin(points[near, :2]) - depth - _CORNER_UNDER_CM * under - points[near, 2]
            share = smooth(_CORNER_END_CM, _CORNER_WHOLE_CM, across[near])
            points[near, 2] += share * _CORNER_SOFT_CM * np.logaddexp(0, missing / _CORNER_SOFT_CM)
        return points

    def _declared_blink(self, side: int) -> Array:
        """The kit's displacement near the eye, with the lower lid's rise and slide as declared."""
        base = self.rest - self.globes[side].centre
        delta = self.kit.expressions[f"eyeBlink_{SIDE_TAGS[side]}"].copy()
        lower = (delta[:, 1] > -0.02) & (base[:, 1] < 0)
        delta[lower, 0] *= self.movement.lower_lid_slide
        delta[lower, 1] *= self.movement.lower_lid_rise
        return np.asarray(delta * smooth(_STILL_CM, _WHOLE_CM, np.linalg.norm(base, axis=1))[:, None])

    def _edges_together(self, points: Array, base: Array, side: int) -> Array:
        """Lower the upper lid, less with distance from its edge, by what is left open at each azimuth."""
        radius, azimuth, elevation = spherical(points)
        _, azimuth0, elevation0 = spherical(base)
        upper, lower = chains(self.kit, self.loops[side][3], side)
        turned = azimuth * side
        at = np.linspace(
            max(turned[upper].min(), turned[lower].min()), min(turned[upper].max(), turned[lower].max()), 60
        )
        edge = _profile(at, turned[upper], elevation[upper])
        gap = edge - _profile(at, turned[lower], elevation[lower]) + _OVERLAP_CM
        started = _profile(at, azimuth0[upper] * side, elevation0[upper])
        stroke = np.maximum(started - edge, 0.02)
        gap = np.convolve(np.pad(gap, 4, "edge"), np.ones(9) / 9, "valid")
        inside = np.clip((at - at[0]) / 0.02, 0, 1) * np.clip((at[-1] - at) / 0.05, 0, 1)
        share = np.clip((elevation0 - elevation) / np.interp(turned, at, stroke), 0, 1)
        share *= (base[:, 2] > 0) & (np.linalg.norm(base, axis=1) < 3.2)
        return cartesian(radius, azimuth, elevation - np.interp(turned, at, gap * inside) * share)

    def _off_the_eye(self, vertices: Array, side: int, stroke: float) -> Array:
        """Lift what is too near the eye, and smoothly its neighbors."""
        loops, globe = self.loops[side], self.globes[side]
        index = np.concatenate(loops[1:])
        least = [*_CLEARANCE_CM, *[_OUTER_CLEARANCE_CM] * len(loops)]
        least_cm = np.concatenate([np.full(len(loop), w) for loop, w in zip(loops[1:], least, strict=False)])
        gap = self.clearance(vertices[index], side, stroke)
        need = _SOFT_CM * np.logaddexp(0, (least_cm - gap) / _SOFT_CM)
        need[gap > least_cm + 6 * _SOFT_CM] = 0
        lift = np.zeros(len(vertices))
        lift[index] = need
        lift = self._spread(lift, side)
        lift[loops[0]] = 0
        lifted = lift > 1e-6
        away = vertices[lifted] - globe.centre
        out = vertices.copy()
        out[lifted] += away / np.linalg.norm(away, axis=1)[:, None] * lift[lifted, None]
        return out

    def _spread(self, lift: Array, side: int) -> Array:
        """The least lift that falls by no more than 18% from vertex to vertex."""
        a, b = self._edges_near(side)
        count = np.maximum(np.bincount(a, minlength=len(lift)) + np.bincount(b, minlength=len(lift)), 1)
        needed = lift
        for _ in range(10):
            total = np.bincount(a, lift[b], len(lift)) + np.bincount(b, lift[a], len(lift))
            lift = np.maximum(needed, 0.82 * total / count)
        return lift

    def _edges_near(self, side: int) -> tuple[Index, Index]:
        edges = self.kit.edges
        near = edges[np.isin(edges, np.concatenate(self.loops[side])).all(axis=1)]
        return near[:, 0], near[:, 1]


def _profile(at: Array, azimuth: Array, elevation: Array) -> Array:
    order = np.argsort(azimuth)
    return np.interp(at, azimuth[order], elevation[order])


def corner_line(path: BlinkPath, side: int) -> tuple[float, float, float, float]:
    """Azimuth and elevation of the nasal corner at rest, slope and azimuth's way to the temporal one."""
    upper, lower = chains(path.kit, path.loops[side][3], side)
    index = np.concatenate([upper, lower])
    _, azimuth, elevation = spherical(path.rest[index] - path.globes[side].centre)
    turned = azimuth * side
    a, b = int(np.argmin(turned)), int(np.argmax(turned))
    slope = (elevation[b] - elevation[a]) / (turned[b] - turned[a])
    return float(turned[a]), float(elevation[a]), float(slope), float(turned[b] - turned[a])


def nasal_tip(path: BlinkPath, posed: Array, side: int, loop: int) -> Array:
    """(3,) vertex of a loop that lies nearest to the nose."""
    upper, _ = chains(path.kit, path.loops[side][loop], side)
    return np.asarray(posed[upper[0]])
