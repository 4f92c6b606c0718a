"""Kenward and Roger's tests of fixed effects: a covariance of the estimates for few groups, and its df.

Sources: Kenward & Roger (1997), doi:10.2307/2533558; Halekoh & Hojsgaard (2014), doi:10.18637/jss.v059.i09.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse, special

from analysis.models.reml import Criterion, CrossProducts
from analysis.models.terms import Term
from experiments.errors import InputError

Floats = NDArray[np.float64]

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
            f"Kenward and Roger's df are for at most {MAX_COEFFICIENTS} random coefficients, this model has "
            f"{size}; with as many groups Satterthwaite's are as good"
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
