"""Cells of a factorial design as sum-coded effects, and as orthonormal contrasts of unit variance."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from analysis.within.contrasts import effect_members, effect_name, orthonormal_basis

Floats = NDArray[np.float64]


def _sum_coding(levels: int) -> Floats:
    """Contrasts of R's contr.sum with a column of ones before them, (levels, levels)."""
    coding = np.eye(levels)[:, :-1]
    coding[-1] = -1.0
    return np.hstack([np.ones((levels, 1)), coding])


def coded_cells(
    factors: list[str], levels: Sequence[Sequence[str]]
) -> tuple[Floats, Floats, tuple[str, ...], tuple[str, ...]]:
    """Both codings (cells, cells), the effect of each column, and the columns' names.

    Parameters
    ----------
    factors : list of str
        Names.
    levels : sequence of sequence of str
        Their levels; cells vary fastest in the last factor.
    """
    sizes = [len(names) for names in levels]
    fixed, spread = [np.ones((int(np.prod(sizes)), 1))], [np.ones((int(np.prod(sizes)), 1))]
    effect_of, names = ["intercept"], ["intercept"]
    for members in effect_members(len(factors)):
        codings: Floats = np.ones((1, 1))
        bases: Floats = np.ones((1, 1))
        for axis, size in enumerate(sizes):
            inside = axis in members
            codings = np.asarray(np.kron(codings, _sum_coding(size)[:, 1:] if inside else np.ones((size, 1))))
            basis = orthonormal_basis(size) * np.sqrt(size)
            bases = np.asarray(np.kron(bases, basis[:, 1:] if inside else np.ones((size, 1))))
        fixed.append(codings)
        spread.append(bases)
        effect = effect_name([factors[m] for m in members])
        effect_of += [effect] * codings.shape[1]
        inner = product(*[levels[m][:-1] for m in members])
        names += [
            ":".join(f"{factors[m]}[{lv}]" for m, lv in zip(members, row, strict=True)) for row in inner
        ]
    return np.hstack(fixed), np.hstack(spread), tuple(effect_of), tuple(names)
