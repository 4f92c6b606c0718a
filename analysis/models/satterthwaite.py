"""Satterthwaite's degrees of freedom for tests of fixed effects (as lmerTest: doi:10.18637/jss.v082.i13)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.models.reml import Criterion, CrossProducts, criterion, unscaled_gradient

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

FLAT = 1e-8
"""Curvature of the deviance, as a share of the largest, below which a direction counts as level.

Of real data it was 1e-4 and more; where two variances cannot be told apart it is 1e-13.
"""

LEAST_THETA = 0.1
"""Directions are compared in steps of the relative standard deviations, or of this."""

MOVED = 1e-6
"""A covariance of estimates that changes by less than this, relative, stays the same."""

STEP = 1e-3

COSTLY = 500
"""With more coefficients than this left to factor, differences are not extrapolated: six digits remain."""


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of beta (f, f), its derivative by (theta, sigma), and the covariance of (theta, sigma).

    `level` (m + 1, k) holds the directions of (theta, sigma) in which the likelihood does not change.
    """

    covariance: Floats = field(repr=False)
    gradient: Floats = field(repr=False)
    parameters: Floats = field(repr=False)
    level: Floats = field(repr=False)
    free: Integers = field(repr=False)

    @property
    def settled(self) -> bool:
        """Whether the covariance of beta is the same wherever the likelihood is as large."""
        change = np.abs(np.tensordot(self.level, self.gradient, ([0], [0])))
        deviations = np.sqrt(np.diag(self.covariance))
        return not (change > MOVED * np.outer(deviations, deviations)).any()

    @property
    def untold(self) -> Integers:
        """The theta whose size the ratings do not tell."""
        weight = np.abs(self.level[:-1]).max(axis=1, initial=0.0)
        untold: Integers = self.free[weight > np.sqrt(FLAT) * weight.max(initial=0.0)]
        return untold

    def f_test(self, beta: Floats, contrasts: Floats) -> tuple[float, int, float, float]:
        r"""F, its two df and p of `contrasts` (q, f) @ beta = 0.

        One df per eigenvector of the contrasts' covariance, pooled by the mean of F (Fai & Cornelius 1996).

        Notes
        -----
        .. math::

            F = \frac{1}{q} \sum_i \frac{(p_i' L \hat\beta)^2}{\lambda_i}, \quad
            \nu_i = \frac{2 \lambda_i^2}{g_i' A g_i} \tag{1}

        lambda and p are eigenvalues and eigenvectors of L C L', C the covariance of beta; g_i is the
        gradient of lambda_i by (theta, sigma), and A the covariance of these.
        """
        covariance = contrasts @ self.covariance @ contrasts.T
        values, vectors = np.linalg.eigh(covariance)
        rotated = vectors.T @ contrasts
        t2 = (rotated @ beta) ** 2 / values
        f_value, q = float(t2.mean()), len(values)
        slopes = np.einsum("qa,kab,qb->qk", rotated, self.gradient, rotated, optimize=True)
        each = 2 * values**2 / np.einsum("qk,kl,ql->q", slopes, self.parameters, slopes, optimize=True)
        df = _pooled(each)
        return f_value, q, df, float(special.fdtrc(q, df, f_value))


def uncertainty(c: CrossProducts, theta: Floats, at: Criterion) -> Uncertainty:
    r"""From the Hessian of the deviance in (theta, sigma) at the REML estimate.

    Notes
    -----
    .. math::

        D &= h(\theta) + 2 \nu \log \sigma + r^2(\theta) / \sigma^2 \tag{2} \\
        \partial^2 D / \partial \sigma^2 &= 4 \nu / \sigma^2, \quad
        \partial^2 D / \partial \sigma \, \partial \theta = -2 (r^2)' / \sigma^3 \quad
        \text{where } \sigma^2 = r^2 / \nu \tag{3} \\
        A &= 2 H^{-1} \tag{4}

    r^2 is the penalised residual sum of squares, h what the random effects' determinants add, H the matrix of
    (3) with the second derivatives by theta, A the covariance of (theta, sigma) in (1).

    A theta at its bound of zero is left out: neither deviance nor covariance changes there to first order.
    """
    sigma, nu = at.sigma, at.nu
    free = np.flatnonzero(np.abs(theta) > 0)
    m = len(free)
    hessian = np.empty((m + 1, m + 1))
    for row, k in enumerate(free):
        hessian[row, :m] = _derivative(c, theta, int(k), sigma)[free]
    hessian[:m, :m] = (hessian[:m, :m] + hessian[:m, :m].T) / 2
    hessian[m, :m] = hessian[:m, m] = -2 * at.grad_r2[free] / sigma**3
    hessian[m, m] = 4 * nu / sigma**2
    steps = np.append(np.maximum(np.abs(theta[free]), LEAST_THETA), sigma)
    values, vectors = np.linalg.eigh(hessian * np.outer(steps, steps))
    directions, least = steps[:, None] * vectors, FLAT * values.max()
    good = values > least
    parameters = 2 * (directions[:, good] / values[good]) @ directions[:, good].T
    gradient = np.concatenate(
        [sigma**2 * unscaled_gradient(c, theta, at)[free], 2 * sigma * at.unscaled[None]]
    )
    level = directions[:, np.abs(values) <= least]
    return Uncertainty(sigma**2 * at.unscaled, gradient, parameters, level, free)


def _derivative(c: CrossProducts, theta: Floats, k: int, sigma: float) -> Floats:
    """Derivative by theta_k of the gradient of h + r2 / sigma^2: differences, extrapolated once if cheap."""

    def slope(step: float) -> Floats:
        up, down = theta.copy(), theta.copy()
        up[k] += step
        down[k] -= step
        a, b = criterion(c, up), criterion(c, down)
        return ((a.grad_h - b.grad_h) + (a.grad_r2 - b.grad_r2) / sigma**2) / (2 * step)

    step = STEP * max(abs(float(theta[k])), 0.05)
    if c.cc.shape[0] > COSTLY:
        return slope(step / 2)
    return (4 * slope(step / 2) - slope(step)) / 3


def _pooled(each: Floats) -> float:
    if len(each) == 1 or np.ptp(each) < 1e-8:
        return float(each.mean())
    if (each <= 2).any():
        return 2.0
    expected = float((each / (each - 2)).sum())
    return 2 * expected / (expected - len(each))
