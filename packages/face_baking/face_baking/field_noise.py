"""Smooth noise at points of space, the same for the same seed."""

import numpy as np

from face_baking.kit import Array

_TABLE = 32


def value_noise(points: Array, seed: int, octaves: int = 3, roughness: float = 0.55) -> Array:
    """(n,) noise about 0 of roughly unit spread at (n, 3) points; a unit of length is one cell."""
    table = np.random.default_rng([seed, 99]).normal(size=(_TABLE,) * 3).astype(np.float32)
    out = np.zeros(len(points))
    for octave in range(octaves):
        sampled = points * 2**octave + 7.3 * octave
        cell = np.floor(sampled).astype(np.int64)
        share = sampled - cell
        share = share * share * (3 - 2 * share)
        out += roughness**octave * _mixed(table, cell, share)
    return out * 1.6


def _mixed(table: np.ndarray, cell: np.ndarray, share: Array) -> Array:
    total = np.zeros(len(cell))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(np.array(corner), share, 1 - share), axis=1)
        x, y, z = ((cell + np.array(corner)) % _TABLE).T
        total += weight * table[x, y, z]
    return total
