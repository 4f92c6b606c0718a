"""Orthonormal contrasts of a factorial within-participant design, and the names of its effects."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@lru_cache(maxsize=64)
def orthonormal_basis(levels: int) -> Floats:
    """Orthogonal (levels, levels) matrix: first column 1/sqrt(levels), the others Helmert contrasts."""
    basis = np.zeros((levels, levels))
    basis[:, 0] = 1.0 / np.sqrt(levels)
    for j in range(1, levels):
        basis[:j, j] = 1.0 / np.sqrt(j * (j + 1))
        basis[j, j] = -j / np.sqrt(j * (j + 1))
    basis.setflags(write=False)
    return basis


def effect_members(n_factors: int) -> list[tuple[int, ...]]:
    """Factor positions of every effect: main effects first, then interactions by order."""
    positions = range(n_factors)
    return [members for order in range(1, n_factors + 1) for members in combinations(positions, order)]


def effect_name(factors: Sequence[str]) -> str:
    """Name of an effect: its factors joined with ':'."""
    return ":".join(factors)


def rotate(y: Floats) -> Floats:
    """Rotate cell means (N, a, b, ...) into contrast space, same shape.

    On every factor axis index 0 is the mean direction, the rest the Helmert contrasts, so that the
    contrast scores of an effect are one slice (see `effect_scores`).
    """
    rotated = y
    for axis in range(1, y.ndim):
        rotated = np.moveaxis(np.tensordot(rotated, orthonormal_basis(y.shape[axis]), (axis, 0)), -1, axis)
    return rotated


def effect_scores(rotated: Floats, members: Sequence[int]) -> Floats:
    """Contrast scores (N, q) of the effect of the factors at positions `members`."""
    inside = set(members)
    cut = tuple(slice(1, None) if axis in inside else slice(0, 1) for axis in range(rotated.ndim - 1))
    return rotated[(slice(None), *cut)].reshape(rotated.shape[0], -1)
