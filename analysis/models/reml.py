"""The REML criterion of crossed participants and items from cross-products, with its gradient.

Model: y = X b + U_p a + U_c c + e with a_i = Lp u_i (p random coefficients of participant i), c = lambda v;
u, v standard normal times sigma. theta are the free entries of Lp, then lambda (relative to sigma), as in
lme4 (Bates et al. 2015, doi:10.18637/jss.v067.i01). After the cross-products trials cost nothing.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from analysis.models.crossing import Crossing, crossing, summed_product

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class CrossProducts:
    """Sums over trials: N participants with p coefficients, J items, f fixed effects.

    `pp` (N, p, p), `pc` (N, p, J; dense or sparse), `cc` (J,), `pb` (N, p, f + 1), `cb` (J, f + 1) and
    `bb` (f + 1, f + 1); the last column of b is y. `patterns` (m, p, p): Lp = sum of theta_k patterns_k.
    """

    n: int
    pp: Floats = field(repr=False)
    pc: Crossing = field(repr=False)
    cc: Floats = field(repr=False)
    pb: Floats = field(repr=False)
    cb: Floats = field(repr=False)
    bb: Floats = field(repr=False)
    patterns: Floats = field(repr=False)

    @property
    def f(self) -> int:
        """Number of fixed effects."""
        return int(self.bb.shape[0]) - 1


def cross_products(
    x: Floats, z: Floats, y: Floats, participant: Integers, item: Integers, patterns: Floats
) -> CrossProducts:
    """Cross-products of trials: x (n, f), z (n, p), y (n,), codes (n,)."""
    n, people, items = len(y), int(participant.max()) + 1, int(item.max()) + 1
    b = np.column_stack([x, y])
    ones, trial = np.ones(n), np.arange(n)
    by_person = sparse.csr_matrix((ones, (participant, trial)), shape=(people, n))
    by_item = sparse.csr_matrix((ones, (item, trial)), shape=(items, n))
    p, width = z.shape[1], b.shape[1]

    def summed(indicator: sparse.csr_matrix, values: Floats) -> Floats:
        return np.asarray(indicator @ values, dtype=np.float64)

    pp = summed(by_person, (z[:, :, None] * z[:, None, :]).reshape(n, -1)).reshape(people, p, p)
    pb = np.stack([summed(by_person, z[:, [k]] * b) for k in range(p)], axis=1).reshape(people, p, width)
    return CrossProducts(
        n,
        pp,
        crossing(z, participant, item, people, items),
        np.bincount(item, minlength=items).astype(np.float64),
        pb,
        summed(by_item, b),
        b.T @ b,
        patterns,
    )


@dataclass(frozen=True)
class Criterion:
    """The model at one theta: deviance parts, estimates, and their derivatives.

    `h` = log|M| + log|X'V^-1 X|, `r2` the penalised residual sum of squares; `grad_h`, `grad_r2` (m + 1,).
    `curve_at_zero` (m + 1,) is what the second derivative of `value` by theta_k would be at theta_k = 0.
    `unscaled` (f, f) is the covariance of beta over sigma^2; `participants_x` (N, p, f) and `items_x` (J, f)
    are U'V^-1 X.
    """

    n: int
    h: float
    r2: float
    grad_h: Floats = field(repr=False)
    grad_r2: Floats = field(repr=False)
    curve_at_zero: Floats = field(repr=False)
    beta: Floats = field(repr=False)
    unscaled: Floats = field(repr=False)
    participants_x: Floats = field(repr=False)
    items_x: Floats = field(repr=False)

    @property
    def sigma(self) -> float:
        """Residual standard deviation at this theta."""
        return float(np.sqrt(self.r2 / (self.n - len(self.beta))))

    @property
    def value(self) -> float:
        """The REML criterion (-2 log restricted likelihood) profiled over beta and sigma."""
        nu = self.n - len(self.beta)
        return float(self.h + nu * (1 + np.log(2 * np.pi * self.r2 / nu)))

    @property
    def gradient(self) -> Floats:
        """Gradient of `value`, (m + 1,)."""
        return self.grad_h + (self.n - len(self.beta)) * self.grad_r2 / self.r2


def criterion(c: CrossProducts, theta: Floats) -> Criterion:
    """Evaluate the REML criterion and its exact gradient at theta (m + 1,)."""
    f, lp, lam = c.f, np.tensordot(theta[:-1], c.patterns, 1), float(theta[-1])
    p, items = lp.shape[0], len(c.cc)
    gl = c.pp @ lp
    mp = lp.T @ gl + np.eye(p)
    vb = lp.T @ c.pb
    wb: Floats = np.asarray(np.linalg.solve(mp, vb), dtype=np.float64)
    out = c.pc.eliminated(lp, mp, gl)
    # kc: U_c' (I + U_p Lp Lp' U_p')^-1 U_c, the items' cross-product with participants taken out
    kc: Floats = np.asarray(np.diag(c.cc) - out.schur(), dtype=np.float64)
    kb = c.cb - out.to_items(wb)
    inverse, log_det = _inverse(np.eye(items) + lam**2 * kc)
    xc = lam * (inverse @ kb)
    xp = wb - lam * out.from_items(xc)
    d = c.bb - vb.reshape(-1, f + 1).T @ xp.reshape(-1, f + 1) - lam * c.cb.T @ xc
    a = d[:f, :f]
    unscaled = np.asarray(np.linalg.inv(a), dtype=np.float64)
    beta = unscaled @ d[:f, f]
    r2 = float(d[f, f] - d[f, :f] @ beta)
    log_m = np.linalg.slogdet(mp)[1].sum() + log_det
    h = float(log_m + np.linalg.slogdet(a)[1])
    # t: U' V^-1 [X y] of participants (N, p, f + 1) and of items (J, f + 1)
    tp = c.pb - gl @ xp - lam * out.plain(xc)
    tc = inverse @ kb
    within = c.pp - gl @ np.linalg.solve(mp, gl.transpose(0, 2, 1))
    k = within.sum(axis=0) - lam**2 * out.quadratic(inverse)
    k -= summed_product(tp[:, :, :f] @ unscaled, tp[:, :, :f])
    k_item = float(np.vdot(inverse, kc)) - float(np.vdot(tc[:, :f] @ unscaled, tc[:, :f]))
    up, uc = tp[:, :, f] - tp[:, :, :f] @ beta, tc[:, f] - tc[:, :f] @ beta
    grad_h = np.r_[2 * np.tensordot(c.patterns, k @ lp, 2), 2 * lam * k_item]
    grad_r2 = np.r_[-2 * np.tensordot(c.patterns, up.T @ up @ lp, 2), -2 * lam * float(uc @ uc)]
    curve = 2 * np.r_[np.tensordot(c.patterns, k, 2), k_item]
    curve = curve - 2 * (c.n - f) / r2 * np.r_[np.tensordot(c.patterns, up.T @ up, 2), float(uc @ uc)]
    return Criterion(c.n, h, r2, grad_h, grad_r2, curve, beta, unscaled, tp[:, :, :f], tc[:, :f])


def _inverse(matrix: Floats) -> tuple[Floats, float]:
    """Inverse and log determinant of a positive definite matrix, by Cholesky."""
    factor, _ = linalg.cho_factor(matrix, lower=True)
    triangle, _ = linalg.lapack.dpotri(factor, lower=True)
    inverse = np.tril(triangle)
    inverse += np.tril(triangle, -1).T
    return inverse, 2 * float(np.log(np.diag(factor)).sum())


def unscaled_gradient(c: CrossProducts, theta: Floats, at: Criterion) -> Floats:
    """Derivative of (X'V^-1 X)^-1 by every theta, (m + 1, f, f): A^-1 X'V^-1 dV V^-1 X A^-1."""
    lp, lam = np.tensordot(theta[:-1], c.patterns, 1), float(theta[-1])
    scaled, items = at.participants_x @ at.unscaled, at.items_x @ at.unscaled
    rotated = (lp.T @ scaled).reshape(-1, c.f)
    half = np.stack([(s.T @ scaled).reshape(-1, c.f).T @ rotated for s in c.patterns])
    return np.concatenate([half + half.transpose(0, 2, 1), 2 * lam * (items.T @ items)[None]])
