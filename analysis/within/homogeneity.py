"""Levene's test: whether groups differ in the spread of their scores."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.within.anova import AnovaResult

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LeveneTest:
    """Levene's test of one column of scores; `where` names the cell, `means` the participants' means.

    F is NaN where nobody differs from the centre of the group, or a group has one participant only.
    """

    where: str
    f_value: float
    df_effect: int
    df_error: int
    p_value: float


def levene_tests(result: AnovaResult) -> tuple[LeveneTest, ...]:
    r"""Test participants' means and every cell of the within factors; nothing where there are no groups.

    Notes
    -----
    One-way F of :math:`d_{ij} = |y_{ij} - \tilde y_j|`, the distances from the median of group j (every
    combination of between levels is a group). Source: Brown & Forsythe (1974).
    """
    if not result.between.factors:
        return ()
    _, groups = np.unique(result.between.codes, axis=0, return_inverse=True)
    flat = result.y.reshape(result.n_participants, -1)
    tests = [_levene("means", flat.mean(axis=1), groups.ravel())]
    if flat.shape[1] > 1:
        names = [":".join(at) for at in _cells(result)]
        tests += [_levene(name, column, groups.ravel()) for name, column in zip(names, flat.T, strict=True)]
    return tuple(tests)


def _cells(result: AnovaResult) -> list[tuple[str, ...]]:
    return list(product(*result.levels))


def _levene(where: str, y: Floats, groups: NDArray[np.int64]) -> LeveneTest:
    k, n = int(groups.max()) + 1, len(y)
    medians = np.array([np.median(y[groups == g]) for g in range(k)])
    d = np.abs(y - medians[groups])
    sizes = np.bincount(groups)
    means = np.bincount(groups, weights=d) / sizes
    between = float((sizes * (means - d.mean()) ** 2).sum()) / (k - 1)
    within = float(((d - means[groups]) ** 2).sum()) / (n - k) if n > k else 0.0
    f = between / within if within > 0 else float("nan")
    p = float(special.fdtrc(k - 1, n - k, f)) if within > 0 else float("nan")
    return LeveneTest(where, f, k - 1, n - k, p)
