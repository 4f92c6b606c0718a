"""Orthonormal contrasts of a factorial within-participant design, and the names of its effects."""

import math
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
    # The mean comes first, so that index 0 of each turned axis averages the factor away.
    basis[:, 0] = 1.0 / np.sqrt(levels)
    for j in range(1, levels):
        basis[:j, j] = 1.0 / np.sqrt(j * (j + 1))
        basis[j, j] = -j / np.sqrt(j * (j + 1))
    # Shared by every caller through the cache: nobody may write into it.
    basis.setflags(write=False)
    return basis


def effect_members(n_factors: int) -> list[tuple[int, ...]]:
    """Factor positions of every effect: main effects first, then interactions by order."""
    positions = range(n_factors)
    return [members for order in range(1, n_factors + 1) for members in combinations(positions, order)]


def effect_name(factors: Sequence[str]) -> str:
    """Name of an effect: its factors joined with ':'."""
    return ":".join(factors)


def contrast_scores(y: Floats) -> tuple[Floats, dict[tuple[int, ...], slice]]:
    """Scores (N, K) of cell means (N, a, b, ...) on the contrasts of every effect, side by side.

    With them the columns of each set of within factors, by their positions. The one column of `()` are the
    scores between participants: their means, centered, in units of one cell.
    """
    n, k = len(y), y[0].size
    cells = y.reshape(n, k)
    # Participants' means are taken out first: contrasts of large ratings would lose their last digits.
    people = cells.sum(axis=1) / k
    scores = cells - people[:, None]
    for size in y.shape[1:]:
        # takes the first axis and puts it last: after all of them their order is as before
        scores = np.swapaxes(scores.reshape(n, size, k // size), 1, 2) @ orthonormal_basis(size)
    order, columns = _by_effect(y.shape[1:])
    scores = scores.reshape(n, k)[:, order]
    # In units of one cell, so that its sum of squares is comparable with those of the contrasts.
    scores[:, 0] = math.sqrt(k) * (people - people.sum() / n)
    return scores, columns


@lru_cache(maxsize=64)
def _by_effect(shape: tuple[int, ...]) -> tuple[NDArray[np.int64], dict[tuple[int, ...], slice]]:
    """Where contrasts lie among the turned cells: index 0 of an axis is its mean, the rest its contrasts."""
    position = np.arange(math.prod(shape)).reshape(shape)
    every = [(), *effect_members(len(shape))]
    parts = [
        position[tuple(slice(1, None) if axis in members else 0 for axis in range(len(shape)))].ravel()
        for members in every
    ]
    ends = np.cumsum([len(part) for part in parts]).tolist()
    columns = {m: slice(end - len(part), end) for m, part, end in zip(every, parts, ends, strict=True)}
    return np.concatenate(parts), columns
