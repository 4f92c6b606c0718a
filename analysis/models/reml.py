"""The (restricted) likelihood of crossed and nested random terms from cross-products, with its gradient.

Model: y = X b + sum_t Z_t (I (x) L_t) u_t + e, u_t and e normal with SD sigma (`terms`). theta are the free
entries of the L_t, relative to sigma, as in lme4 (Bates et al. 2015, doi:10.18637/jss.v067.i01). After the
cross-products trials cost nothing. With V = I + Z L L'Z' over sigma^2, the grouping with the most
coefficients is taken out first, which is a division by its p x p blocks; what is left, S = I + L'K L of the
J other coefficients, is factored by Cholesky (`schur`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from analysis.models.crossing import Crossing, crossing, summed_product
from analysis.models.schur import Rest
from analysis.models.terms import Block, Term, intercept_term, placed

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CrossProducts:
    """Sums over trials: f fixed effects; `first` (N levels, p columns) is taken out, J columns are the rest.

    `pp` (N, p, p), `crossed` (N, p, J), `cc` (J, J) sparse, `pb` (N, p, f + 1), `cb` (J, f + 1) and
    `bb` (f + 1, f + 1); the last column of b is y. `blocks` are all terms in their order.
    """

    n: int
    blocks: tuple[Block, ...]
    first: Block
    pp: Floats = field(repr=False)
    crossed: Crossing = field(repr=False)
    cc: sparse.csr_matrix = field(repr=False)
    pb: Floats = field(repr=False)
    cb: Floats = field(repr=False)
    bb: Floats = field(repr=False)

    @property
    def f(self) -> int:
        """Number of fixed effects."""
        return int(self.bb.shape[0]) - 1

    @property
    def rest(self) -> tuple[Block, ...]:
        """The terms that are not taken out first."""
        return tuple(block for block in self.blocks if block is not self.first)


def cross_products(x: Floats, y: Floats, terms: Sequence[Term]) -> CrossProducts:
    """Cross-products of trials: x (n, f), y (n,)."""
    at = int(np.argmax([term.size for term in terms]))
    first, b = terms[at], np.column_stack([x, y])
    blocks = placed(terms, at)
    matrices = [term.matrix() for k, term in enumerate(terms) if k != at]
    rest = sparse.hstack(matrices, format="csr") if matrices else sparse.csr_matrix((len(y), 0))
    z = first.matrix()
    pairs = first.z[:, :, None] * first.z[:, None, :]
    indicator = intercept_term(first.codes, first.levels).matrix()
    pp = np.asarray(indicator.T @ pairs.reshape(len(y), -1)).reshape(first.levels, first.p, first.p)
    return CrossProducts(
        len(y),
        tuple(blocks),
        blocks[at],
        pp,
        crossing(z, rest, first.p),
        sparse.csr_matrix(rest.T @ rest),
        np.asarray(z.T @ b).reshape(first.levels, first.p, -1),
        np.asarray(rest.T @ b),
        b.T @ b,
    )


@dataclass(frozen=True)
class Criterion:
    """The model at one theta: deviance parts, estimates, and their derivatives.

    `h` = log|V|, with log|X'V^-1 X| for REML, `r2` the penalised residual sum of squares; `grad_h`, `grad_r2`
    (m,). `curve_at_zero` (m,) is what the second derivative of `value` by theta_k would be at theta_k = 0.
    `unscaled` (f, f) is the covariance of beta over sigma^2; `terms_x` are Z_t'V^-1 X (levels, p, f) of every
    term. `nu` = n - f for REML, n for maximum likelihood.
    """

    nu: int
    h: float
    r2: float
    grad_h: Floats = field(repr=False)
    grad_r2: Floats = field(repr=False)
    curve_at_zero: Floats = field(repr=False)
    beta: Floats = field(repr=False)
    unscaled: Floats = field(repr=False)
    terms_x: tuple[Floats, ...] = field(repr=False)

    @property
    def sigma(self) -> float:
        """Residual standard deviation at this theta."""
        return float(np.sqrt(self.r2 / self.nu))

    @property
    def value(self) -> float:
        """-2 log (restricted) likelihood profiled over beta and sigma."""
        return float(self.h + self.nu * (1 + np.log(2 * np.pi * self.r2 / self.nu)))

    @property
    def gradient(self) -> Floats:
        """Gradient of `value`, (m,)."""
        return self.grad_h + self.nu * self.grad_r2 / self.r2


def criterion(c: CrossProducts, theta: Floats, reml: bool = True) -> Criterion:
    """Evaluate the criterion and its exact gradient at theta (m,)."""
    f, lp = c.f, c.first.factor(theta)
    gl = c.pp @ lp
    mp = lp.T @ gl + np.eye(len(lp))
    vb = lp.T @ c.pb
    wb: Floats = np.asarray(np.linalg.solve(mp, vb), dtype=np.float64)
    out = c.crossed.eliminated(lp, mp, gl)
    rest = Rest(c.rest, theta, c.cc, out, c.cb - out.to_rest(wb))
    xp = wb - out.from_rest(rest.solution)
    d = c.bb - vb.reshape(-1, f + 1).T @ wb.reshape(-1, f + 1) - rest.explained
    unscaled = np.asarray(np.linalg.inv(d[:f, :f]), dtype=np.float64)
    beta = unscaled @ d[:f, f]
    r2 = float(d[f, f] - d[f, :f] @ beta)
    # traces: sums over levels of Z_t'V^-1 Z_t (p, p); scores: Z_t'V^-1 [X y] (levels, p, f + 1)
    within = (c.pp - gl @ np.linalg.solve(mp, gl.transpose(0, 2, 1))).sum(axis=0)
    lead = within - out.quadratic(rest.inner), c.pb - gl @ xp - out.plain(rest.solution)
    of_rest = iter(rest.traces_and_scores())
    each = [lead if block is c.first else next(of_rest) for block in c.blocks]
    h = np.linalg.slogdet(mp)[1].sum() + rest.log_det + (np.linalg.slogdet(d[:f, :f])[1] if reml else 0.0)
    grad_h, grad_r2, curve = [], [], []
    nu = c.n - f if reml else c.n
    for block, (trace, score) in zip(c.blocks, each, strict=True):
        factor, residual = block.factor(theta), score[:, :, f] - score[:, :, :f] @ beta
        squares = residual.T @ residual
        if reml:
            trace = trace - summed_product(score[:, :, :f] @ unscaled, score[:, :, :f])
        grad_h.append(2 * np.tensordot(block.patterns, trace @ factor, 2))
        grad_r2.append(-2 * np.tensordot(block.patterns, squares @ factor, 2))
        curve.append(2 * np.tensordot(block.patterns, trace - nu / r2 * squares, 2))
    return Criterion(
        nu,
        float(h),
        r2,
        np.concatenate(grad_h),
        np.concatenate(grad_r2),
        np.concatenate(curve),
        beta,
        unscaled,
        tuple(score[:, :, :f] for _, score in each),
    )


def unscaled_gradient(c: CrossProducts, theta: Floats, at: Criterion) -> Floats:
    """Derivative of (X'V^-1 X)^-1 by every theta, (m, f, f): A^-1 X'V^-1 dV V^-1 X A^-1."""
    slopes = []
    for block, x in zip(c.blocks, at.terms_x, strict=True):
        scaled = x @ at.unscaled
        rotated = (block.factor(theta).T @ scaled).reshape(-1, c.f)
        half = np.stack([(s.T @ scaled).reshape(-1, c.f).T @ rotated for s in block.patterns])
        slopes.append(half + half.transpose(0, 2, 1))
    return np.concatenate(slopes)
