"""What stands out of the lids' skin or goes into it: folds, furrows, bags, flesh, grain."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from face_baking.blink_path import BlinkPath
from face_baking.field_noise import value_noise
from face_baking.identity import Identity
from face_baking.kit import Array
from face_baking.lid_coordinates import LID_MIDDLE, LidCoordinates
from face_baking.lid_loops import SIDES, chains
from stimuli_builder.characters.colour import smooth

FLESH_LOOPS, FLESH_ENDS, FLESH_CM = (0, 1, 2, 3), (2, 4), (0.02, 0.07)
"""Loops whose nasal ends are flesh, vertices of it on each one's upper and lower half, and how far it reaches
next to them.

What lies between the lids' ends is the kit's own caruncle, and with a skin's color it was a pale hook about
the white. Skin begins at the loop of the lashes: as far as the sixth loop the flesh looked like a bruise.
"""
FOLD_UNROLLS, FOLD_STRETCHED = (0.68, 1.0), (0.0, 0.35)
"""Strokes in which the upper lid's fold unrolls, and in which the skin below it is drawn out of it.

A fold that went in proportion to the stroke was gone at once: an aperture closed, no flap of skin. Out of the
stretched skin it needs more depth and roll to be as dark as on the open lid, and is narrower.
"""
STRETCHED_DEPTH, STRETCHED_ROLL, STRETCHED_WIDTH = 0.8, 0.5, 0.10
"""By how much: shares more, and mesh loops less."""
FOLD_STEP = 0.6
"""Width of the fold's upper slope over that of its lower one."""
FOLD_REMAINS = 0.85
"""Share of the fold that a shut lid keeps: in recordings its crease and the step above it stay."""
MOUND_RISE_CM, MOUND_CM = 0.05, 0.10
"""How far the caruncle stands out of the fold, and where it has fallen to 1/e of that."""


class LidRelief:
    """Relief of one face's skin about the eyes.

    Parameters
    ----------
    coordinates : LidCoordinates
        Where each vertex lies on the lids.
    flat : float64 array (n, 3)
        Vertices of the shut lids, on which the grain is drawn, cm.
    flesh : CornerFlesh
        The flesh of the nasal corners.
    identity : Identity
        Whose folds, age and seed.
    """

    def __init__(
        self, coordinates: LidCoordinates, flat: Array, flesh: "CornerFlesh", identity: Identity
    ) -> None:
        self.coordinates, self.flesh, self._mound = coordinates, flesh.share, flesh.mound
        self._flat, self._lids, self._seed = flat, identity.lids, identity.seed
        self._years = age_depth(identity.skin.age)

    @cached_property
    def _waves(self) -> tuple[Array, Array, Array]:
        """Noise along the lid (which bends the fold), across it (fine lines) and of the skin's surface."""
        at, seed = self.coordinates, self._seed
        zero = np.zeros_like(at.loop)
        along = np.stack([at.azimuth * 2.2, at.side * 3, zero], -1)
        lines = np.stack([at.azimuth * 3.0 + 11 * at.side, at.loop * 1.9, zero], -1)
        return (
            0.35 * value_noise(along, seed + 5, 2),
            value_noise(lines, seed + 8, 3),
            value_noise(self._flat * 4.5, seed + 30, 3),
        )

    def displacement(self, stroke: Array) -> Array:
        """(n,) cm along the normal, at each vertex's stroke: folds, the nasal corner's flesh, grain."""
        at, surface, opened = self.coordinates, self._waves[2], 1 - stroke
        grain = 0.0020 * surface * smooth(3.5, 6.0, at.loop)
        mound = MOUND_RISE_CM * opened * self._mound * np.maximum(1 + 0.5 * surface, 0)
        return np.asarray(self._upper_folds(stroke) + self._lower_folds() + grain + mound)

    @cached_property
    def above_fold(self) -> Array:
        """(n,) mesh loops by which each vertex lies above the upper lid's fold."""
        at = self.coordinates
        height = self._lids.crease + 0.35 * self._waves[0]
        height = height - 0.9 * smooth(0.1, -0.8, at.azimuth) - 0.5 * smooth(0.5, 1.2, at.azimuth)
        return np.asarray(at.loop - height)

    @cached_property
    def fold_reach(self) -> Array:
        """(n,) 1 along the upper lid's fold, 0 at both corners and below the eye."""
        at = self.coordinates
        return np.asarray(smooth(-0.85, -0.35, at.azimuth) * smooth(1.25, 0.75, at.azimuth) * at.upper)

    def _upper_folds(self, stroke: Array) -> Array:
        """The open lid's fold, what is left of it on a shut lid, and that one's lines."""
        at, lids = self.coordinates, self._lids
        wander, lines, _ = self._waves
        years, above, envelope = self._years, self.above_fold, self.fold_reach
        opened = smooth(FOLD_UNROLLS[1], FOLD_UNROLLS[0], stroke)
        opened = FOLD_REMAINS + (1 - FOLD_REMAINS) * opened
        stretched = opened * smooth(*FOLD_STRETCHED, stroke)
        # Of one depth from end to end it was a line drawn round the eye: it runs out, and is nowhere gone.
        uneven = np.clip(0.95 + 0.4 * wander - 0.25 * np.abs(at.azimuth - LID_MIDDLE), 0.6, 1.1)
        width = 0.30 + 0.18 * opened - STRETCHED_WIDTH * stretched
        # The lid slips under the skin above it: a step, and no groove with two equal slopes.
        width = np.where(above > 0, FOLD_STEP * width, width)
        depth = (0.026 + 0.026 * opened) * (1 + STRETCHED_DEPTH * stretched)
        roll = 0.034 * opened * (1 + STRETCHED_ROLL * stretched)
        fold = -lids.depth * uneven * depth * np.exp(-((above / width) ** 2))
        fold += lids.depth * roll * np.exp(-(((above - 0.95) / 0.7) ** 2))
        second = np.exp(-(((above - 1.5) / 0.22) ** 2)) * (0.4 + 0.6 * stroke)
        fold -= 0.012 * years * second * np.clip(0.5 + 1.2 * wander, 0, 1)
        furrows = np.exp(-((lines / 0.22) ** 2)) * smooth(3.6, 5.0, at.loop) * smooth(11.5, 8.5, at.loop)
        fold -= (0.006 * years + 0.005 * stroke) * furrows
        return np.asarray(fold * envelope)

    def _lower_folds(self) -> Array:
        """The bag below the eye, its fold and its lines."""
        at, years = self.coordinates, self._years
        wander, lines, _ = self._waves
        below = (1 - at.upper) * smooth(-0.9, -0.5, at.azimuth) * smooth(1.2, 0.8, at.azimuth)
        bag = 0.010 * years * np.exp(-(((at.loop - 5.2) / 1.0) ** 2))
        bag -= 0.016 * np.exp(-(((at.loop - 7.6 - 0.8 * wander) / 0.55) ** 2))
        bag -= 0.004 * (years - 0.4) * np.exp(-((lines / 0.25) ** 2)) * smooth(4.0, 6.0, at.loop)
        return np.asarray(bag * below)


@dataclass(frozen=True, eq=False)
class CornerFlesh:
    """The flesh between the lids' edges at the nose.

    Attributes
    ----------
    share : float64 array (n,)
        1 on it, 0 from `FLESH_CM[1]` away from it.
    mound : float64 array (n,)
        Share (0-1) of `MOUND_RISE_CM` that the caruncle has, before the skin's grain.
    """

    share: Array
    mound: Array


def corner_flesh(path: BlinkPath, rest: Array) -> CornerFlesh:
    """The flesh of both nasal corners, at each of the (n, 3) resting vertices."""
    upper, lower = FLESH_ENDS
    here, middles = [], []
    for side in SIDES:
        halves = [chains(path.kit, path.loops[side][k], side) for k in FLESH_LOOPS]
        ends = np.stack([path.rest[np.concatenate([u[upper - 1 : 0 : -1], v[:lower]])] for u, v in halves])
        here.append(_between(_between(ends).swapaxes(0, 1)).reshape(-1, 3))
        middles.append(here[-1].mean(axis=0))
    away, _ = cKDTree(np.concatenate(here)).query(rest)
    share = smooth(FLESH_CM[1], FLESH_CM[0], away)
    from_middle, _ = cKDTree(np.stack(middles)).query(rest)
    return CornerFlesh(share, share * np.exp(-((from_middle / MOUND_CM) ** 2)))


def _between(points: Array) -> Array:
    """(4 n - 3, ...) points with three more between each and the next."""
    at = np.linspace(0, len(points) - 1, 4 * len(points) - 3)
    low = np.minimum(at.astype(np.int64), len(points) - 2)
    share = (at - low).reshape(-1, *[1] * (points.ndim - 1))
    return np.asarray(points[low] + share * (points[low + 1] - points[low]))


def age_depth(age: float) -> float:
    """Depth of lines and furrows relative to 35 years."""
    return float(np.clip(0.35 + 0.65 * (age - 18) / 17, 0.3, 2.2))
