"""Tests of fixed effects with the degrees of freedom of Satterthwaite or Kenward and Roger."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse, special

from analysis.models.reml import Criterion, CrossProducts, Term, criterion, unscaled_gradient
from experiments.errors import InputError

# Satterthwaite's degrees of freedom for tests of fixed effects (as lmerTest: doi:10.18637/jss.v082.i13).

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

FLAT = 1e-8
"""Curvature of the deviance, as a share of the largest, below which a direction counts as level.

Of real data it was 1e-4 and more; where two variances cannot be separated it is 1e-13.
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
        """The theta whose size the ratings do not determine."""
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

    r^2 is the penalized residual sum of squares, h what the random effects' determinants add, H the matrix of
    (3) with the second derivatives by theta, A the covariance of (theta, sigma) in (1).

    A theta at its bound of zero is left out: neither deviance nor covariance changes there to first order.
    """
    sigma, nu = at.sigma, at.nu
    free = np.flatnonzero(np.abs(theta) > 0)
    m = len(free)
    hessian = np.empty((m + 1, m + 1))
    for row, k in enumerate(free):
        hessian[row, :m] = _derivative(c, theta, int(k), sigma)[free]
    # Differences leave the two triangles apart by their error, and eigh reads only one of them.
    hessian[:m, :m] = (hessian[:m, :m] + hessian[:m, :m].T) / 2
    hessian[m, :m] = hessian[:m, m] = -2 * at.grad_r2[free] / sigma**3
    hessian[m, m] = 4 * nu / sigma**2
    # In steps of the parameters' own sizes: whether a direction is level must not depend on units.
    steps = np.append(np.maximum(np.abs(theta[free]), LEAST_THETA), sigma)
    values, vectors = np.linalg.eigh(hessian * np.outer(steps, steps))
    directions, least = steps[:, None] * vectors, FLAT * values.max()
    # Only curved directions: the inverse of a level one would be rounding of any size.
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

    # A theta near zero still needs a step that moves the criterion.
    step = STEP * max(abs(float(theta[k])), 0.05)
    if c.cc.shape[0] > COSTLY:
        return slope(step / 2)
    # Richardson's extrapolation: the error in the square of the step cancels.
    return (4 * slope(step / 2) - slope(step)) / 3


def _pooled(each: Floats) -> float:
    if len(each) == 1 or np.ptp(each) < 1e-8:
        return float(each.mean())
    # With 2 error df or fewer F has no mean to pool by; lmerTest takes 2 there as well.
    if (each <= 2).any():
        return 2.0
    expected = float((each / (each - 2)).sum())
    return 2 * expected / (expected - len(each))


# Kenward and Roger's tests of fixed effects: a covariance of the estimates for few groups, and its df.
#
# Sources: Kenward & Roger (1997), doi:10.2307/2533558; Halekoh & Hojsgaard (2014), doi:10.18637/jss.v059.i09.

MAX_COEFFICIENTS = 4000
"""Random coefficients up to which the dense products below are waited for (some seconds)."""

ROUNDING = 1e-6
"""What is closer to zero, of terms near 1, is their rounding: A2 carries that of the variances' estimates."""


@dataclass(frozen=True)
class KenwardRoger:
    r"""What the tests need of a fitted model, in units of the residual variance.

    Attributes
    ----------
    sigma : float
        Residual standard deviation.
    phi : (f, f) array
        Covariance of the estimates were the variances known, :math:`\Phi = (X'V^{-1}X)^{-1}`.
    adjusted : (f, f) array
        :math:`\Phi_A`, eq. 3.
    slopes : (m + 1, f, f) array
        P, eq. 1: derivatives of :math:`X'V^{-1}X` by the m variances of random terms, and by the scale of V.
    parameters : (m + 1, m + 1) array
        W, the asymptotic covariance of these.
    """

    sigma: float
    phi: Floats = field(repr=False)
    adjusted: Floats = field(repr=False)
    slopes: Floats = field(repr=False)
    parameters: Floats = field(repr=False)

    @cached_property
    def covariance(self) -> Floats:
        """Adjusted covariance of the estimates (f, f)."""
        return np.asarray(self.sigma**2 * self.adjusted)

    def f_test(self, beta: Floats, contrasts: Floats) -> tuple[float, int, float, float]:
        r"""F, its two df and p of `contrasts` (q, f) @ beta = 0.

        Parameters
        ----------
        beta : (f,) array
            Estimates.
        contrasts : (q, f) array
            L, of full row rank.

        Returns
        -------
        tuple of (float, int, float, float)
            F scaled as below, q, denominator df, p.

        Notes
        -----
        With :math:`\Theta = L'(L \Phi L')^{-1}L`:

        4. :math:`A_1 = \sum_{ij} W_{ij} \mathrm{tr}(\Theta\Phi P_i\Phi) \mathrm{tr}(\Theta\Phi P_j\Phi)`,
           :math:`A_2 = \sum_{ij} W_{ij} \mathrm{tr}(\Theta\Phi P_i\Phi\Theta\Phi P_j\Phi)`,
           :math:`B = (A_1 + 6 A_2) / 2q`;
        5. :math:`g = ((q+1)A_1 - (q+4)A_2) / ((q+2)A_2)`, and over :math:`3q + 2(1-g)`:
           :math:`c_1 = g, c_2 = q - g, c_3 = q + 2 - g`;
        6. :math:`\rho = \frac{1}{q} \left(\frac{1 - A_2/q}{1 - c_2 B}\right)^2
           \frac{1 + c_1 B}{1 - c_3 B}`, :math:`m = 4 + (q + 2)/(q\rho - 1)`,
           :math:`\lambda = m(1 - A_2/q)/(m - 2)`;
        7. :math:`F = \frac{\lambda}{q} (L\beta)'(L\Phi_A L')^{-1}L\beta` on q and m df.
        """
        q = len(contrasts)
        theta = contrasts.T @ np.linalg.solve(contrasts @ self.phi @ contrasts.T, contrasts)
        turned = theta @ self.phi @ self.slopes @ self.phi
        traces = np.trace(turned, axis1=1, axis2=2)
        a1 = float(traces @ self.parameters @ traces)
        a2 = float(np.einsum("ij,iab,jba->", self.parameters, turned, turned, optimize=True))
        df, scale = _df_and_scale(q, a1, a2)
        estimate = contrasts @ beta
        spread = contrasts @ self.covariance @ contrasts.T
        f_value = scale * float(estimate @ np.linalg.solve(spread, estimate)) / q
        return f_value, q, df, float(special.fdtrc(q, df, f_value))


def _df_and_scale(q: int, a1: float, a2: float) -> tuple[float, float]:
    """Denominator df and the factor of F, eq. 5 and 6.

    For q = 1 these are 2 / A2 and 1 exactly. The ratio squared in rho is 0 / 0, hence 1, at 2 df.
    """
    if q == 1:
        return 2 / a2, 1.0
    b = (a1 + 6 * a2) / (2 * q)
    g = ((q + 1) * a1 - (q + 4) * a2) / ((q + 2) * a2)
    over = 3 * q + 2 * (1 - g)
    c1, c2, c3 = g / over, (q - g) / over, (q + 2 - g) / over
    rest, below = 1 - a2 / q, 1 - c2 * b
    ratio = 1.0 if max(abs(rest), abs(below)) < ROUNDING else rest / below
    numerator = 1 + c1 * b
    numerator = 0.0 if abs(numerator) < 1e-10 else numerator
    # (q + 2) / (q rho - 1), without a division by 1 - c3 B, which is zero at 4 df
    df = 4 + (q + 2) * (1 - c3 * b) / (ratio**2 * numerator - (1 - c3 * b))
    return df, 1.0 if abs(df - 2) < 1e-2 else df * rest / (df - 2)


def kenward_roger(terms: Sequence[Term], c: CrossProducts, theta: Floats, at: Criterion) -> KenwardRoger:
    r"""The adjusted covariance of the estimates and what the df are made from.

    Parameters
    ----------
    terms : sequence of Term
        Random terms, in the order of the cross-products.
    c : CrossProducts
    theta : (m,) array
        Relative standard deviations at the REML estimate.
    at : Criterion
        The criterion there.

    Raises
    ------
    InputError
        More random coefficients than can be waited for.

    Notes
    -----
    V is linear in the variances, :math:`\partial V / \partial \gamma_i = G_i = Z D_i Z'`, and in its own
    scale, :math:`G = V`. Any linear change of the parameters leaves the adjustment as it is, so that the
    residual variance, whose products need :math:`V^{-2}`, is traded for the scale. In units of
    :math:`\sigma^2`, with :math:`M = Z'V^{-1}Z` and :math:`T = Z'V^{-1}X`:

    1. :math:`P_i = -T'D_iT`, :math:`Q_{ij} = T'D_iMD_jT`, :math:`K_{ij} = \mathrm{tr}(D_iMD_jM)`; for the
       scale :math:`P = -A, Q_i = -P_i, Q = A, K_i = \mathrm{tr}(D_iM), K = n`, where
       :math:`A = X'V^{-1}X = \Phi^{-1}`;
    2. :math:`W = 2 I^{-1}`, :math:`I_{ij} = K_{ij} - 2\,\mathrm{tr}(\Phi Q_{ij}) +
       \mathrm{tr}(\Phi P_i \Phi P_j)`;
    3. :math:`\Phi_A = \Phi + 2\Phi \sum_{ij} W_{ij}(Q_{ij} - P_i\Phi P_j) \Phi`.
    """
    size = sum(term.size for term in terms)
    if size > MAX_COEFFICIENTS:
        raise InputError(
            f"Kenward-Roger df support at most {MAX_COEFFICIENTS} random coefficients, but this model has "
            f"{size}; with so many groups, use Satterthwaite's"
        )
    m = _inner(terms, [block.factor(theta) for block in c.blocks])
    phi = at.unscaled
    precision = np.linalg.inv(phi)
    directions = list(_directions(terms))
    scores = np.concatenate([x.reshape(-1, c.f) for x in at.terms_x])
    moved = [_applied(terms, one, scores) for one in directions]
    through = m @ np.concatenate(moved, axis=1)
    count, f = len(directions) + 1, c.f
    slopes, q, k = np.empty((count, f, f)), np.empty((count, count, f, f)), np.empty((count, count))
    images = [_applied(terms, one, m) for one in directions]
    for i, (own, image) in enumerate(zip(moved, images, strict=True)):
        slopes[i] = -scores.T @ own
        q[i, -1] = q[-1, i] = -slopes[i]
        k[i, -1] = k[-1, i] = np.trace(image)
        for j, other in enumerate(images):
            q[i, j] = own.T @ through[:, j * f : (j + 1) * f]
            k[i, j] = np.einsum("ab,ba->", image, other)
    slopes[-1], q[-1, -1], k[-1, -1] = -precision, precision, c.n
    scaled = phi @ slopes
    information = k - 2 * np.einsum("ab,ijba->ij", phi, q) + np.einsum("iab,jba->ij", scaled, scaled)
    parameters = 2 * _inverse((information + information.T) / 2)
    products = np.einsum("iab,jbc->ijac", slopes @ phi, slopes)
    u = np.einsum("ij,ijab->ab", parameters, q - products)
    adjusted = phi + 2 * phi @ ((u + u.T) / 2) @ phi
    return KenwardRoger(at.sigma, phi, adjusted, slopes, parameters)


def _inverse(information: Floats) -> Floats:
    """Inverse of an information matrix; what carries none (a pattern that two terms share) stays out."""
    # To a unit diagonal, so that the cutoff does not depend on the sizes of the variances.
    unit = 1 / np.sqrt(np.diag(information))
    return np.asarray(
        np.linalg.pinv(information * np.outer(unit, unit), rcond=1e-10, hermitian=True)
    ) * np.outer(unit, unit)


def _inner(terms: Sequence[Term], factors: Sequence[Floats]) -> Floats:
    """Z'V^-1 Z (J, J) by Woodbury's identity."""
    z = sparse.hstack([term.matrix() for term in terms], format="csr")
    products = np.asarray((z.T @ z).toarray(), dtype=np.float64)
    spread = linalg.block_diag(
        *(np.kron(np.eye(t.levels), one) for t, one in zip(terms, factors, strict=True))
    )
    # The matrix to factor, I + L'Z'Z L, is as large as the coefficients; V is as large as the ratings.
    half = spread.T @ products
    lower = np.linalg.cholesky(np.eye(len(half)) + half @ spread)
    solved = linalg.solve_triangular(lower, half, lower=True, check_finite=False)
    return np.asarray(products - solved.T @ solved)


@dataclass(frozen=True)
class _Direction:
    """The derivative D of a term's covariance (p, p) by one variance or covariance, for every level."""

    term: int
    d: Floats = field(repr=False)


def _directions(terms: Sequence[Term]) -> Iterator[_Direction]:
    """A direction for each variance (a pattern on the diagonal) and each covariance (one below it)."""
    for number, term in enumerate(terms):
        for pattern in term.patterns:
            # A covariance is in the matrix twice, below the diagonal and above it.
            yield _Direction(number, np.maximum(pattern, pattern.T))


def _applied(terms: Sequence[Term], direction: _Direction, values: Floats) -> Floats:
    """D values, values (J, m): zero outside the term's rows."""
    start = sum(term.size for term in terms[: direction.term])
    term = terms[direction.term]
    rows = slice(start, start + term.size)
    out = np.zeros_like(values)
    own = values[rows].reshape(term.levels, term.p, -1)
    out[rows] = (direction.d @ own).reshape(term.size, -1)
    return out
