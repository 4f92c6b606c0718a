"""Levene's test and Box's M: whether groups differ in the spread of their scores."""

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

    F is NaN where nobody differs from the center of the group, or a group has one participant only.
    """

    where: str
    f_value: float
    df_effect: int
    df_error: int
    p_value: float


@dataclass(frozen=True)
class BoxTest:
    """Box's M: whether groups have one covariance matrix of their cells; `reason` says why there is none."""

    m: float | None
    chi2: float | None
    df: int
    p_value: float | None
    reason: str | None = None


def box_test(result: AnovaResult) -> BoxTest | None:
    r"""Box's M of the cells of the factors within, chi-squared approximation; None where nothing is compared.

    Notes
    -----
    With :math:`\nu_i` the df of group i, S_i its covariance matrix of p cells and S the pooled one,

    .. math::

        M = \nu \ln|S| - \sum_i \nu_i \ln|S_i|, \quad \nu = \sum_i \nu_i \tag{1}

        c = \frac{2p^2 + 3p - 1}{6(p + 1)(g - 1)} \left(\sum_i 1/\nu_i - 1/\nu\right) \tag{2}

    and (1 - c) M is referred to chi-squared on p (p + 1) (g - 1) / 2 df. Source: Box (1949), Biometrika 36.
    """
    flat = result.y.reshape(result.n_participants, -1)
    p = flat.shape[1]
    if not result.between.factors or p < 2:
        return None
    # Every combination of between levels is a group.
    _, groups = np.unique(result.between.codes, axis=0, return_inverse=True)
    own = [flat[groups.ravel() == g] for g in range(int(groups.max()) + 1)]
    df = p * (p + 1) * (len(own) - 1) // 2
    nu = np.array([len(y) - 1 for y in own], dtype=np.float64)
    # A covariance matrix of p cells from fewer people has determinant 0.
    if nu.min() < p:
        few = int(nu.min()) + 1
        reason = f"a group has {few} participants for {p} cells; it takes more participants than cells"
        return BoxTest(None, None, df, None, reason)
    matrices = np.stack([np.cov(y, rowvar=False) for y in own])
    # Weighted by df, as the groups' own matrices divide by them.
    pooled = np.tensordot(nu / nu.sum(), matrices, 1)
    # Logarithms: determinants of many cells are beyond the range of floats.
    signs, logs = np.linalg.slogdet(np.concatenate([matrices, pooled[None]]))
    if (signs <= 0).any():
        return BoxTest(None, None, df, None, "a group's covariance matrix is singular")
    m = float(nu.sum() * logs[-1] - nu @ logs[:-1])
    c = (2 * p**2 + 3 * p - 1) / (6 * (p + 1) * (len(own) - 1)) * float((1 / nu).sum() - 1 / nu.sum())
    chi2 = (1 - c) * m
    # The correction may exceed 1 in very small groups.
    return BoxTest(m, chi2, df, float(special.chdtrc(df, max(chi2, 0.0))))


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
    # With one cell the means are that cell.
    if flat.shape[1] > 1:
        names = [":".join(at) for at in _cells(result)]
        tests += [_levene(name, column, groups.ravel()) for name, column in zip(names, flat.T, strict=True)]
    return tuple(tests)


def _cells(result: AnovaResult) -> list[tuple[str, ...]]:
    return list(product(*result.levels))


def _levene(where: str, y: Floats, groups: NDArray[np.int64]) -> LeveneTest:
    r"""Levene's test about medians, Brown and Forsythe (1974).

    .. math::

        F = \frac{\sum_g n_g (\bar d_g - \bar d)^2 / (k - 1)}
                 {\sum_{gi} (d_{gi} - \bar d_g)^2 / (n - k)}, \quad d_{gi} = |y_{gi} - \tilde y_g| \tag{1}

    over k groups g of n_g people, n altogether; y tilde a group's median.
    """
    k, n = int(groups.max()) + 1, len(y)
    # About medians, which skewed ratings disturb less than means do.
    medians = np.array([np.median(y[groups == g]) for g in range(k)])
    d = np.abs(y - medians[groups])
    sizes = np.bincount(groups)
    means = np.bincount(groups, weights=d) / sizes
    between = float((sizes * (means - d.mean()) ** 2).sum()) / (k - 1)
    within = float(((d - means[groups]) ** 2).sum()) / (n - k) if n > k else 0.0
    # Nobody differs from the center: there is nothing to divide by.
    f = between / within if within > 0 else float("nan")
    p = float(special.fdtrc(k - 1, n - k, f)) if within > 0 else float("nan")
    return LeveneTest(where, f, k - 1, n - k, p)
