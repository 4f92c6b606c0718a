"""Lashes and brow hairs as polylines: each hair is ((k, 3) points in mm, root radius in mm)."""

from dataclasses import dataclass

import numpy as np

from stimuli_builder.characters.photorealistic import anatomy
from stimuli_builder.characters.photorealistic.curves import Array
from stimuli_builder.characters.photorealistic.eyelid_skin import LidEdges
from stimuli_builder.characters.photorealistic.parameters import Hair

LASH_POINTS, BROW_POINTS = 14, 9
Strand = tuple[Array, float]


@dataclass(frozen=True)
class _LashRow:
    """What makes upper and lower lashes differ."""

    upper: bool
    nasal: float
    temporal: float
    clump_mm: float
    radius_mm: float


_UPPER = _LashRow(True, -11.4, 12.6, 1.15, 0.056)
_LOWER = _LashRow(False, -10.5, 12.2, 1.5, 0.030)


def lashes(edges: LidEdges, side: int, hair: Hair, seed: int) -> tuple[list[Strand], list[Strand]]:
    """Upper and lower lashes of one eye, rooted on the lids' front edges wherever these are now."""
    rng = np.random.default_rng(seed)
    upper = _lash_row(edges.upper_front, edges, side, _UPPER, hair.upper_lashes, hair.lash_length, rng)
    lower = _lash_row(edges.lower_front, edges, side, _LOWER, hair.lower_lashes, hair.lash_length, rng)
    return upper, lower


def _lash_row(
    front: Array,
    edges: LidEdges,
    side: int,
    row: _LashRow,
    count: int,
    scale: float,
    rng: np.random.Generator,
) -> list[Strand]:
    x = np.sort(rng.uniform(row.nasal, row.temporal, count))
    clump = np.round(x / row.clump_mm)
    chosen = np.flatnonzero(np.sign(edges.x) == side)
    order = chosen[np.argsort(edges.local_x[chosen])]
    roots = np.stack([np.interp(x, edges.local_x[order], front[order, k]) for k in range(3)], -1)
    strands = []
    for root, at, group in zip(roots, x, clump, strict=True):
        gather = x[clump == group].mean() - at
        length, fan, rows, curl = _upper_lash(at, gather, rng) if row.upper else _lower_lash(at, gather, rng)
        points = _lash(root, side, row.upper, length * scale, fan, rows, curl)
        strands.append((points, row.radius_mm * rng.normal(1, 0.14)))
    return strands


def _upper_lash(at: float, gather: float, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Length, sideways fan, offset of the root's row and curl: longest towards the temple."""
    q = (at + 0.5) / 13
    length = 5.7 + 1.8 * np.exp(-(((at - 5.5) / 5.5) ** 2))
    length -= 1.9 * np.clip((-at - 6) / 6, 0, 1) + 1.5 * np.clip((at - 10.5) / 2.5, 0, 1)
    fan = 0.9 * (0.42 * q + 0.06 * q * abs(q)) + gather * 0.085 + rng.normal(0, 0.10)
    return length * rng.normal(0.95, 0.17), fan, rng.uniform(-0.15, 0.35), rng.normal(0.92, 0.17)


def _lower_lash(at: float, gather: float, rng: np.random.Generator) -> tuple[float, float, float, float]:
    length = (2.5 + 1.0 * np.exp(-(((at - 5) / 6) ** 2))) * rng.normal(0.95, 0.18)
    fan = 0.38 * at / 13 + gather * 0.12 + rng.normal(0, 0.09)
    return length, fan, rng.uniform(-0.25, 0.1), rng.normal(1.0, 0.18)


def _lash(root: Array, side: int, upper: bool, length: float, fan: float, rows: float, curl: float) -> Array:
    """Grow along the globe's radius, bending away from the fissure, fanned sideways."""
    radial = root - np.array([side * anatomy.EYE_X_MM, 0.0, 0.0])
    radial = radial / np.linalg.norm(radial)
    tangent = np.array([0.0, -radial[2], radial[1]]) * (1 if upper else -1)
    tangent /= np.linalg.norm(tangent)
    start, end = (38.0, 38.0 - 95.0 * curl) if upper else (-18.0, -62.0 * curl)
    share = np.linspace(0, 1, LASH_POINTS)[1:, None]
    angle = np.radians(start + (end - start) * share**0.9)
    along = np.cos(angle) * radial + np.sin(angle) * tangent
    along = along + np.array([side * fan, 0.0, 0.0]) * (0.75 + 0.35 * share)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    first = root - 0.25 * radial + (rows - 0.12) * tangent
    return np.asarray(np.vstack([first, first + np.cumsum(along * length / (LASH_POINTS - 1), axis=0)]))


def brow(side: int, hair: Hair, seed: int) -> list[Strand]:
    """One eyebrow: strong hairs and, between them, a third as many short fine ones that soften its edge."""
    rng = np.random.default_rng(seed)
    flat, lift, radius = [], [], []
    for index in range(hair.brow_hairs):
        along = rng.uniform() ** 0.95
        fine = index % 3 == 0
        if along < 0.14 and rng.random() < (0.14 - along) / 0.14 * 0.6:
            continue
        grown = _brow_hair(side, along, fine, hair.brow_height, rng)
        flat.append(grown[0])
        lift.append(grown[1])
        radius.append(grown[2])
    if not flat:
        return []
    places = np.stack(flat)
    z = anatomy.closed_skin(places[..., 0], places[..., 1]) - 0.15 + np.stack(lift)
    return list(zip(np.dstack([places, z]), radius, strict=True))


def brow_line(along: Array | float) -> Array:
    """Height of the brow's middle at a share of its length from the nose; left brow 0.6 mm higher."""
    u = np.clip(along, 0, 1)
    return np.asarray(17.3 + 5.2 * np.sin(u**0.9 * np.pi * 0.78) - 2.4 * u**3)


def brow_half_height(along: Array | float) -> Array:
    """Half the brow's thickness in mm."""
    return np.asarray(np.interp(along, [0, 0.08, 0.3, 0.6, 0.85, 1], [2.0, 3.2, 3.4, 2.7, 1.6, 0.5]))


def _brow_hair(
    side: int, along: float, fine: bool, height: float, rng: np.random.Generator
) -> tuple[Array, Array, float]:
    """(k, 2) frontal positions, (k,) lift off the skin, and radius of one hair."""
    across = float(np.clip(rng.normal(0, 0.62 if fine else 0.5), -1.3, 1.2))
    y = (
        float(brow_line(along))
        + float(brow_half_height(along)) * height * across
        + (0.6 if side < 0 else 0.0)
    )
    # Inner hairs stand up, outer ones lie along the brow; upper and lower rows lean together.
    lean = np.interp(along, [0, 0.12, 0.3, 0.6, 1], [68, 54, 36, 18, -14])
    lean -= across * np.interp(along, [0, 0.2, 0.5, 1], [8, 22, 24, 14]) - rng.normal(0, 9)
    length = np.interp(along, [0, 0.15, 0.6, 1], [3.6, 5.6, 6.8, 4.6]) * rng.normal(0.85, 0.17)
    length *= 0.55 if fine else 1.0
    share = np.linspace(0, 1, BROW_POINTS)
    angle = np.radians(lean) - np.radians(rng.normal(24, 7)) * share
    steps = np.stack([side * np.cos(angle), np.sin(angle)], -1)[:-1] * length / (BROW_POINTS - 1)
    flat = np.array([side * (13.5 + along * 42), y]) + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    lift = rng.uniform(0.12, 0.5) * np.sin(np.pi * np.minimum(share * 0.75, 1)) * 0.9
    radius = (0.018 if fine else 0.030) * np.interp(along, [0, 0.2, 1], [0.8, 1.0, 0.9])
    return flat, lift, float(radius * np.clip(rng.normal(1, 0.2), 0.5, 1.6))
