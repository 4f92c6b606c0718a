"""Per-vertex pigments, gloss, pores and furrows of the resting skin, for the skin's shader."""

import numpy as np
from scipy.spatial import cKDTree

from face_baking.blink_path import nasal_tip
from face_baking.field_noise import value_noise
from face_baking.kit import Array
from face_baking.lid_coordinates import LID_MIDDLE
from face_baking.lid_loops import EDGE_LOOP, SIDES
from face_baking.lid_relief import age_depth
from face_baking.lid_skin import FaceSkin, normals
from stimuli_builder.characters.colour import smooth

SPOTS = 220
LID_MELANIN, LID_BLOOD, LID_ROUGH, LID_DULL = 0.25, 0.07, 0.12, 0.6
"""The upper lid against the skin about it: pigments, roughness, and the share of gloss that it lacks.

As oily as a brow, a shut lid shone as bright as the catchlight that it had covered.
"""
RIM_BLOOD = 0.13
"""Optical depth of blood that a lid's wet margin has beyond the skin's; about the pupil half of it."""
UPPER_MARGIN, LOWER_MARGIN = 1.3, 0.25
"""Optical depth of melanin that a lid's margin has beyond the skin's: lashes' roots are dark."""
RIM_PALER = 0.35
"""Share of its melanin that a light skin lacks on the lids' wet margins.

Dark skin, paler there by as much, had a bright band all along its lower lids, as if it wore goggles.
"""
FOLD_MELANIN, FOLD_BLOOD, FOLD_WIDE = 0.22, 0.10, 0.4
"""What the skin in the upper lid's fold has more than the lid's, and its half width in mesh loops: when the
fold unrolls, a line of it remains."""
CORNER_CM, CORNER_BLOOD = 0.30, 0.28
"""Reach and added blood of a nasal corner's duller skin: lit and smooth, its fold shone as a white dot."""
LID_VESSELS = 0.10
"""Optical depth of blood in vessels that shine through the upper lid, the thinnest skin there is."""
FLESH_BLOOD, FLESH_PALER, FLESH_WET = 0.38, 0.5, 0.2
"""The flesh of a nasal corner against the skin about it: blood more, share of melanin (of light skin;
of dark skin less) and roughness less."""
NOSE, CHIN, BRIDGE, NOSTRILS, LIPS = 30, 8, 27, (31, 35), slice(48, 60)
"""Numbers of Multi-PIE landmarks."""


class Pigments:
    """Draws the shader's per-vertex values of one face."""

    def __init__(self, skin: FaceSkin) -> None:
        self.skin, self.look, self.rest = skin, skin.identity.skin, skin.rest
        # Texture is drawn on the shut lids: on the open ones a blink stretched it into upright streaks.
        self.flat = skin.flat
        self.seed = skin.identity.seed
        self.landmarks = skin.path.rest[skin.path.kit.landmarks]
        self.front = smooth(2.0, 5.0, self.rest[:, 2])
        self.dark = self.look.melanin > 0.4
        # Foreshortened toward the temples, fine noise becomes upright streaks. About the closed lids: of the
        # open ones, skin that lies in their fold would have too little of it when it comes out.
        self.facing = smooth(0.25, 0.75, normals(skin.flat, skin.fine.quads)[:, 2])
        # Fine speckle is per vertex: as noise in the shader it doubled the time of a render. It is fainter on
        # the lids, where the blink stretches it into streaks.
        self.calm = self.facing * (0.35 + 0.65 * smooth(8.0, 13.0, skin.coordinates.loop))
        self.contrast = min(1.0, (0.2 / self.look.melanin) ** 0.5)
        self.centres = {side: skin.path.globes[side].centre for side in SIDES}

    def values(self) -> dict[str, Array]:
        """Values by attribute name: (n,) or, of coordinates, (n, 3)."""
        lips = self._lips()
        wet, fine, coordinates = self._lid_values()
        lid, corner, flesh = self._upper_lid(), self._nasal_corner(), self.skin.relief.flesh
        paler = FLESH_PALER * self.contrast
        melanin = self._varied_melanin(lips, wet, lid) * (1 - paler * flesh)
        haemoglobin = self._varied_haemoglobin(lips, wet, lid, corner) + FLESH_BLOOD * flesh
        rough = self._roughness(lips) + LID_ROUGH * np.maximum(lid, corner) - FLESH_WET * flesh
        warp = 0.045 * np.stack([self._noise(3.5, k, 2) for k in (19, 20, 21)], -1)
        return {
            "rest": self.flat,
            "warp": self.flat + warp,
            "lidc": coordinates,
            "mel": np.clip(melanin, 0.02, None),
            "hem": np.clip(haemoglobin, 0.02, None),
            "pore": np.clip(self._pores(lips), 0, 1.5)
            * np.clip(0.7 + 0.4 * self._noise(5.0, 16, 1), 0.15, 1.2),
            "net": np.clip(0.75 + 0.35 * self._noise(2.6, 17, 2), 0.2, 1.3) * age_depth(self.look.age) ** 0.5,
            "rough": np.clip(rough, 0.2, 0.6),
            "shine": (1 - LID_DULL * lid) * (1 - 0.85 * corner * (1 - flesh)),
            "wet": wet,
            "fine": fine * age_depth(self.look.age) ** 0.7,
        }

    def _varied_melanin(self, lips: Array, wet: Array, lid: Array) -> Array:
        """(n,) optical depth of melanin with what varies it: lids, margins, mottling, speckle, freckles."""
        upper, uneven = self.skin.coordinates.upper, np.clip(1 + 0.5 * self._noise(7.0, 42, 2), 0.4, 1.5)
        out = self._melanin(lips) * (1 - RIM_PALER * self.contrast * wet) * (1 + LID_MELANIN * lid)
        out *= 1 + FOLD_MELANIN * self._fold()
        out += wet * uneven * (UPPER_MARGIN * upper + LOWER_MARGIN * (1 - upper))
        mottled = self._noise(1.3, 11) + self.facing * self._noise(6.0, 12)
        out *= 1 + self.contrast * 0.10 * mottled
        out *= np.clip(1 + self.contrast * self.calm * 0.16 * self._noise(11.0, 22, 3), 0.5, 1.6)
        return np.asarray(out + self._spots())

    def _varied_haemoglobin(self, lips: Array, wet: Array, lid: Array, corner: Array) -> Array:
        """(n,) optical depth of blood with what varies it: margins, mottling, speckle, the lids' vessels."""
        out = self._haemoglobin(lips) + wet * self._rim_blood() + LID_BLOOD * lid + CORNER_BLOOD * corner
        out *= 1 + 0.13 * self._noise(1.8, 13, 4) + 0.15 * self.facing * self._noise(9.0, 14)
        out += FOLD_BLOOD * self._fold()
        out += LID_VESSELS * lid * np.exp(-((self._noise(4.5, 43, 3) / 0.07) ** 2))
        return np.asarray(out * np.clip(1 + self.calm * 0.18 * self._noise(15.0, 23, 2), 0.5, 1.6))

    def _fold(self) -> Array:
        """(n,) 1 in the upper lids' fold, 0 away from it."""
        relief = self.skin.relief
        return np.asarray(relief.fold_reach * np.exp(-((relief.above_fold / FOLD_WIDE) ** 2)))

    def _rim_blood(self) -> Array:
        """(n,) blood of the lids' wet margins, more toward the corners: even, it is a drawn line."""
        outer = np.abs(self.skin.coordinates.azimuth - LID_MIDDLE)
        shaded = 1 - 0.6 * self.skin.coordinates.upper
        return np.asarray(
            shaded * np.clip(RIM_BLOOD * (0.5 + 0.7 * outer + 0.45 * self._noise(4.0, 41, 2)), 0, None)
        )

    def _noise(self, scale: float, offset: int, octaves: int = 3) -> Array:
        return value_noise(self.flat * scale, self.seed + offset, octaves) / 1.9

    def _spot(self, centre: Array, width: float, height: float) -> Array:
        x, y = self.rest[:, 0] - centre[0], self.rest[:, 1] - centre[1]
        return np.asarray(np.exp(-((x / width) ** 2 + (y / height) ** 2) / 2) * self.front)

    def _near_eye(self, side: int, x: float, y: float, width: float, height: float) -> Array:
        """A spot at (x toward the temple, y up) from an eye's center, cm."""
        return self._spot(self.centres[side] + np.array([side * x, y, 0]), width, height)

    def _lips(self) -> Array:
        outline = self.landmarks[LIPS, :2]
        if self.rest[:, 1].min() > outline[:, 1].max() + 0.5:
            return np.zeros(len(self.rest))
        distance = _polygon_distance(self.rest[:, :2], outline)
        return np.asarray((self.rest[:, 2] > 5) / (1 + np.exp(np.clip((distance + 0.03) / 0.055, -60, 60))))

    def _melanin(self, lips: Array) -> Array:
        base, around = self.look.melanin, 0.55 if self.dark else 1.0
        tired = 0.75 + 0.25 * age_depth(self.look.age)
        out = base * (1 + 0.06 * self.contrast * value_noise(self.rest * 0.35, self.seed + 1, 3))
        for side in SIDES:
            lids = 0.30 * tired * self._near_eye(side, -0.3, -0.9, 1.3, 0.35)
            lids += 0.22 * self._near_eye(side, 0, 0.75, 1.7, 0.45) + 0.10 * self._near_eye(
                side, 0, 0, 2.2, 1.5
            )
            out += base * around * lids
        out += base * 0.10 * self._spot(self.landmarks[BRIDGE] + np.array([0, 3.5, 0]), 4.5, 2.2)
        return np.asarray(out + lips * (0.05 + 0.10 * base))

    def _haemoglobin(self, lips: Array) -> Array:
        out = self.look.haemoglobin * (1 + 0.06 * value_noise(self.rest * 0.5, self.seed + 2, 3))
        for side in SIDES:
            out += 0.11 * self._near_eye(side, 1.0, -3.2, 1.5, 1.2) + 0.05 * self._near_eye(
                side, 0.4, -2.4, 1.6, 0.9
            )
            out += 0.05 * self._near_eye(side, -0.9, -0.85, 0.9, 0.35) + 0.06 * self._near_eye(
                side, 0, 0.7, 1.6, 0.35
            )
            out += 0.09 * self._near_eye(side, -1.5, -0.2, 0.4, 0.5) + 0.05 * self._near_eye(
                side, 1.35, -0.2, 0.4, 0.5
            )
        out += 0.22 * self._spot(self.landmarks[NOSE], 0.9, 0.8)
        out += sum(0.16 * self._spot(self.landmarks[k], 0.5, 0.6) for k in NOSTRILS)
        out += 0.10 * self._spot(self.landmarks[CHIN] + np.array([0, 1.3, 0]), 1.2, 0.9)
        out -= 0.07 * self._spot(self.landmarks[BRIDGE] + np.array([0, 2.8, 0]), 3.5, 1.6)
        return np.asarray(out + lips * (0.30 if self.dark else 0.42))

    def _roughness(self, lips: Array) -> Array:
        broad = value_noise(self.rest * 0.35, self.seed + 1, 3)
        out = 0.45 + 0.03 * broad + (0.04 if self.dark else 0.0) - 0.13 * lips
        out -= 0.09 * self._spot(self.landmarks[NOSE] + np.array([0, 1.0, 0]), 0.9, 2.0)
        out -= 0.06 * self._spot(self.landmarks[BRIDGE] + np.array([0, 2.8, 0]), 3.0, 1.5)
        return np.asarray(out - 0.05 * (self.skin.coordinates.loop < 7) + 0.04 * self._noise(8.0, 18, 2))

    def _upper_lid(self) -> Array:
        """(n,) 1 on the upper lids' skin, 0 at their margins and from the fold upwards."""
        at = self.skin.coordinates
        return np.asarray(smooth(2.8, 4.5, at.loop) * smooth(12.5, 8.5, at.loop) * at.upper)

    def _nasal_corner(self) -> Array:
        """(n,) 1 at the nasal corners of the open eyes, 0 from twice `CORNER_CM` on."""
        tips = np.stack(
            [nasal_tip(self.skin.path, self.skin.path.rest, side, EDGE_LOOP + 1) for side in SIDES]
        )
        away, _ = cKDTree(tips).query(self.rest)
        return smooth(2 * CORNER_CM, 0.5 * CORNER_CM, away)

    def _pores(self, lips: Array) -> Array:
        depth = 0.8 + 0.2 * age_depth(self.look.age)
        out = 0.50 * depth + 0.55 * self._spot(self.landmarks[NOSE], 1.3, 1.2)
        for side in SIDES:
            out += 0.45 * depth * self._near_eye(side, -0.6, -3.0, 1.5, 1.3)
            out *= 1 - 0.92 * np.clip(1.25 * self._near_eye(side, 0, 0.1, 1.6, 0.9), 0, 1)
        out += 0.30 * self._spot(self.landmarks[BRIDGE] + np.array([0, 2.5, 0]), 3.0, 1.5)
        return np.asarray(out * (1 - lips))

    def _lid_values(self) -> tuple[Array, Array, Array]:
        """Wetness, depth of fine lines, and (n, 3) coordinates along and across the lids."""
        at, n = self.skin.coordinates, len(self.rest)
        wet, fine, lines = np.zeros(n), np.zeros(n), np.zeros((n, 3))
        uneven = np.clip(0.75 + 0.3 * value_noise(self.rest * 1.6, self.seed + 40, 2), 0.1, 1.3)
        for side in SIDES:
            here = (at.side == side) & (self.rest[:, 2] > 4)
            centre, loop = self.centres[side], at.loop
            turn = np.arctan2(self.rest[:, 1] - centre[1], (self.rest[:, 0] - centre[0]) * side)
            lid = np.where(loop < 13.5, loop * 1.5, 20) + at.upper * 30
            lines[here] = np.stack([turn * 2.2 + side * 40, lid, np.zeros(n)], -1)[here]
            wet[here] = (smooth(4.1, 3.3, loop) * (0.25 + 0.75 * smooth(-0.75, -0.45, at.azimuth)))[here]
            corner = np.exp(-(((at.azimuth - 1.05) / 0.45) ** 2))
            reach = smooth(2.8, 5.5, loop) * smooth(13.6, 9.0, loop)
            # Across the line of the corners the coordinate goes from lower to upper lid at once: its lines
            # ran together there into a brown streak beyond either corner.
            apart = np.clip(1 - 8 * at.upper * (1 - at.upper), 0, 1)
            fine[here] = (reach * (0.6 + 0.4 * corner) * uneven * apart)[here]
        return wet, fine, lines

    def _spots(self) -> Array:
        """Freckles and a few small moles as added melanin."""
        rng = np.random.default_rng([self.seed, 15])
        out = np.zeros(len(self.rest))
        loop = self.skin.coordinates.loop
        places = np.flatnonzero((self.rest[:, 2] > 5) & (loop > 6))
        tree = cKDTree(self.flat)
        for point in rng.choice(places, SPOTS):
            mole = rng.random() < 0.04
            size = rng.uniform(0.05, 0.09) if mole else rng.uniform(0.015, 0.05)
            strength = (0.25 if mole else 0.13) * rng.uniform(0.3, 1)
            near = tree.query_ball_point(self.flat[point], 0.22)
            distance2 = ((self.flat[near] - self.flat[point]) ** 2).sum(1)
            # A blink draws the skin of the lids to several times its height, and a mole with it to a streak.
            stays = smooth(8.0, 13.0, loop[point]) if mole else 0.3 + 0.7 * smooth(7.0, 12.0, loop[point])
            out[near] += stays * strength * np.exp(-distance2 / size**2)
        return self.look.freckles * out * (1.0 + self.look.melanin)


def _polygon_distance(points: Array, outline: Array) -> Array:
    """(n,) signed distance of (n, 2) points to a closed polygon, below 0 inside, at most 9."""
    inside, distance = np.zeros(len(points), bool), np.full(len(points), 9.0)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = b - a
        share = np.clip(((points - a) @ along) / (along @ along), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(points - a - share[:, None] * along, axis=1))
        straddles = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        crossing = (points[:, 1] - a[1]) / (along[1] + 1e-12) * along[0] + a[0]
        inside ^= straddles & (points[:, 0] < crossing)
    return np.where(inside, -distance, distance)
