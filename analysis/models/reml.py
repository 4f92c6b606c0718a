"""The (restricted) likelihood of a mixed model: random terms, cross-products, gradient."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

# Random terms: which coefficients differ between the levels of a grouping, and their relative factors.

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Term:
    """Coefficients of the columns z (n, p) that differ between the levels of one grouping.

    `codes` (n,) name each trial's level. The coefficients of a level are L u sigma, u standard normal;
    L = sum of theta_k patterns_k, `patterns` (m, p, p).
    """

    codes: Integers = field(repr=False)
    levels: int
    z: Floats = field(repr=False)
    patterns: Floats = field(repr=False)

    @property
    def p(self) -> int:
        """Number of coefficients of a level."""
        return int(self.z.shape[1])

    @property
    def size(self) -> int:
        """Number of coefficients of all levels."""
        return self.levels * self.p

    def matrix(self) -> sparse.csr_matrix:
        """Z (n, levels p), the p columns of a level side by side."""
        n = len(self.codes)
        columns = self.codes[:, None] * self.p + np.arange(self.p)
        rows = np.arange(0, n * self.p + 1, self.p)
        return sparse.csr_matrix((self.z.ravel(), columns.ravel(), rows), shape=(n, self.size))


def intercept_term(codes: Integers, levels: int) -> Term:
    """An intercept of every level."""
    return Term(codes, levels, np.ones((len(codes), 1)), np.ones((1, 1, 1)))


@dataclass(frozen=True)
class Block:
    """Where a term is: `theta` among the parameters, `columns` among the rest (none if it is first)."""

    levels: int
    patterns: Floats = field(repr=False)
    theta: slice
    columns: slice

    def factor(self, theta: Floats) -> Floats:
        """L (p, p)."""
        return np.asarray(np.tensordot(theta[self.theta], self.patterns, 1))

    def applied(self, factor: Floats, values: Floats) -> Floats:
        """`factor` (p, p) times the p rows of every level in values (levels p, m)."""
        if factor.shape == (1, 1):
            return np.asarray(factor[0, 0] * values)
        p, width = factor.shape[0], values.shape[1]
        return np.asarray(factor @ values.reshape(self.levels, p, width)).reshape(-1, width)

    def diagonal_blocks(self, matrix: Floats) -> Floats:
        """Sum (p, p) of the diagonal blocks of matrix (levels p, levels p)."""
        p = self.patterns.shape[1]
        total = [[matrix.diagonal(b - a)[a::p].sum() if b >= a else 0.0 for b in range(p)] for a in range(p)]
        upper = np.array(total)
        return np.asarray(upper + np.triu(upper, 1).T)


def blocks_of_terms(terms: Sequence[Term], first: int) -> list[Block]:
    """The blocks of terms, with term `first` taken out and the others side by side in their order."""
    blocks, theta, column = [], 0, 0
    for k, term in enumerate(terms):
        size = 0 if k == first else term.size
        columns = slice(column, column + size)
        column += size
        blocks.append(Block(term.levels, term.patterns, slice(theta, theta + len(term.patterns)), columns))
        theta += len(term.patterns)
    return blocks


# Cross-products of the grouping taken out first with all others, dense where most met, sparse where few did.
#
# N levels with p columns each are taken out; J is the number of columns of the rest.

SPARSE_BELOW = 0.15
"""Share of cross-products other than zero below which they are kept sparse, where they are many."""

MANY = 100_000
"""N p J^2 / p^2 from which sparse products, p^2 of which are waited for, may be faster than dense ones."""


class EliminatedGrouping(Protocol):
    """Cross-products with the first grouping taken out, at one Lp; m is any number of columns."""

    def schur(self) -> Floats:
        """V'W (J, J) with V = Lp'P, W = M^-1 V, P the cross-products, M = I + Lp'Z'Z Lp."""

    def to_rest(self, values: Floats) -> Floats:
        """V' values (J, m) of values (N, p, m)."""

    def from_rest(self, values: Floats) -> Floats:
        """W values (N, p, m) of values (J, m)."""

    def plain(self, values: Floats) -> Floats:
        """P values (N, p, m) of values (J, m)."""

    def quadratic(self, inner: Floats) -> Floats:
        """Sum over levels of Q inner Q' (p, p), Q = P - Z'Z Lp W, inner (J, J) symmetric."""


class GroupingProducts(Protocol):
    """Cross-products of random-effect columns, (N, p, J)."""

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> EliminatedGrouping:
        """Take the first grouping out: Lp (p, p), M (N, p, p), Z'Z Lp (N, p, p)."""


def grouping_products(first: sparse.csr_matrix, rest: sparse.csr_matrix, p: int) -> GroupingProducts:
    """Cross-products of `first` (n, N p), the p columns of a level side by side, with `rest` (n, J)."""
    sums = sparse.csr_matrix(first.T @ rest)
    rows, columns = sums.shape
    many = rows * columns**2 > MANY * p**2
    if many and sums.nnz < SPARSE_BELOW * rows * columns:  # without a rest it is dense
        return SparseCrossing(sums, p)
    return DenseCrossing(np.asarray(sums.toarray(), dtype=np.float64).reshape(rows // p, p, columns))


@dataclass(frozen=True)
class DenseCrossing:
    """`sums` (N, p, J)."""

    sums: Floats = field(repr=False)

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> "DenseEliminated":
        """See `GroupingProducts`."""
        v = lp.T @ self.sums
        return DenseEliminated(self.sums, v, np.asarray(np.linalg.solve(mp, v), dtype=np.float64), gl)


@dataclass(frozen=True)
class DenseEliminated:
    """See `EliminatedGrouping`."""

    p: Floats = field(repr=False)
    v: Floats = field(repr=False)
    w: Floats = field(repr=False)
    gl: Floats = field(repr=False)

    def schur(self) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(_flat(self.v).T @ _flat(self.w))

    def to_rest(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(_flat(self.v).T @ _flat(values))

    def from_rest(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(self.w @ values)

    def plain(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(self.p @ values)

    def quadratic(self, inner: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        q = self.p - self.gl @ self.w
        return summed_product(q @ inner, q)


def _flat(values: Floats) -> Floats:
    """(N p, m) of (N, p, m), also where m is 0."""
    n, p, width = values.shape
    return values.reshape(n * p, width)


def summed_product(a: Floats, b: Floats) -> Floats:
    """Sum over levels of a_i b_i', both (N, p, m)."""
    n, p, width = a.shape
    # One product of wide matrices is faster than a small one for every level.
    turned = (values.transpose(1, 0, 2).reshape(p, n * width) for values in (a, b))
    return np.asarray(next(turned) @ next(turned).T)


@dataclass(frozen=True)
class SparseCrossing:
    """`sums` (N p, J): the p rows of a level are adjacent."""

    sums: sparse.csr_matrix = field(repr=False)
    p: int

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> "SparseEliminated":
        """See `GroupingProducts`."""
        people = self.sums.shape[0] // self.p
        v = (_blocks(np.broadcast_to(lp.T, (people, self.p, self.p))) @ self.sums).tocsr()
        w = (_blocks(np.asarray(np.linalg.inv(mp), dtype=np.float64)) @ v).tocsr()
        q = (self.sums - _blocks(gl) @ w).tocsr()
        return SparseEliminated(self.sums, v, w, q, self.p)


def _blocks(matrices: Floats) -> sparse.bsr_matrix:
    """Block-diagonal matrix of (N, p, p)."""
    n, p = matrices.shape[:2]
    at = (np.ascontiguousarray(matrices), np.arange(n), np.arange(n + 1))
    return sparse.bsr_matrix(at, shape=(n * p, n * p))


@dataclass(frozen=True)
class SparseEliminated:
    """See `EliminatedGrouping`."""

    sums: sparse.csr_matrix = field(repr=False)
    v: sparse.csr_matrix = field(repr=False)
    w: sparse.csr_matrix = field(repr=False)
    q: sparse.csr_matrix = field(repr=False)
    p: int

    def schur(self) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray((self.v.T @ self.w).toarray(), dtype=np.float64)

    def to_rest(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(self.v.T @ values.reshape(-1, values.shape[2]))

    def from_rest(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(self.w @ values).reshape(-1, self.p, values.shape[1])

    def plain(self, values: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        return np.asarray(self.sums @ values).reshape(-1, self.p, values.shape[1])

    def quadratic(self, inner: Floats) -> Floats:
        """See `EliminatedGrouping`."""
        columns = [self.q[a :: self.p] for a in range(self.p)]
        total = np.empty((self.p, self.p))
        for a in range(self.p):
            for b in range(a + 1):
                both = sparse.coo_matrix(columns[a].T @ columns[b])
                total[a, b] = total[b, a] = both.data @ inner[both.row, both.col]
        return total


# What is left of the random terms once the largest is taken out: S = I + L'K L (J, J), factored whole.

WELL_CONDITIONED = 0.02
"""Relative SDs above this let Z'V^-1 Z be read off the inverse of S."""


class SchurComplement:
    """The rest of the terms at one theta, by a dense Cholesky factor.

    K = Z'V_1^-1 Z (J, J) and `kb` = Z'V_1^-1 [X y] (J, m) are cross-products with the first term taken out.
    """

    def __init__(
        self,
        blocks: Sequence[Block],
        theta: Floats,
        cc: sparse.csr_matrix,
        out: EliminatedGrouping,
        kb: Floats,
    ) -> None:
        self._blocks = blocks
        self._factors = [block.factor(theta) for block in blocks]
        self._k: Floats = np.asarray(cc.toarray() - out.schur(), dtype=np.float64)
        self._kb = kb
        self._lk = self._left(self._k)
        # K is symmetric: L'(L'K)' is L'K L.
        s = self._left(self._lk.T)
        s[np.diag_indices(len(s))] += 1.0
        # LAPACK refuses matrices without rows
        self._r = linalg.cholesky(s, lower=True, overwrite_a=True, check_finite=False) if len(s) else s
        self.log_det = 2 * float(np.log(np.diag(self._r)).sum())
        half = self._solved(self._left(kb))
        self.explained: Floats = half.T @ half
        """[X y]'V_1^-1 Z L S^-1 L'Z'V_1^-1 [X y] (m, m)."""
        self.solution = self._spread(self._solved(half, transposed=True))
        """L S^-1 L'Z'V_1^-1 [X y] (J, m)."""
        self._inverse = self._inverted()
        self.inner = self._spread(self._spread(self._inverse).T)
        """L S^-1 L' (J, J)."""

    def _left(self, values: Floats) -> Floats:
        """L' values."""
        return self._applied([factor.T for factor in self._factors], values)

    def _spread(self, values: Floats) -> Floats:
        """L values."""
        return self._applied(self._factors, values)

    def _applied(self, factors: Sequence[Floats], values: Floats) -> Floats:
        parts = [b.applied(f, values[b.columns]) for b, f in zip(self._blocks, factors, strict=True)]
        return np.concatenate(parts) if len(parts) > 1 else parts[0] if parts else values.copy()

    def _solved(self, values: Floats, transposed: bool = False) -> Floats:
        if not len(self._r):
            return values
        trans: Literal[0, 1] = 1 if transposed else 0
        solved = linalg.solve_triangular(self._r, values, lower=True, trans=trans, check_finite=False)
        return np.asarray(solved, dtype=np.float64)

    def _inverted(self) -> Floats:
        if not len(self._r):
            return self._r
        # the factor's upper triangle is zero, and stays so
        inverse, _ = linalg.lapack.dpotri(self._r, lower=True)
        diagonal = np.diag(inverse).copy()
        inverse = inverse + inverse.T
        np.fill_diagonal(inverse, diagonal)
        return np.asarray(inverse)

    def traces_and_scores(self) -> Iterator[tuple[Floats, Floats]]:
        """For every term, the sum over levels of Z'V^-1 Z (p, p), and Z'V^-1 [X y] (levels, p, m)."""
        scores = self._kb - self._k @ self.solution
        for block, factor in zip(self._blocks, self._factors, strict=True):
            at, p = block.columns, factor.shape[0]
            # The short way divides by L twice: where a relative SD is small, that would lose the digits.
            if np.linalg.svd(factor, compute_uv=False).min() > WELL_CONDITIONED:
                # K - K L S^-1 L'K = L^-T (I - S^-1) L^-1
                lost = block.levels * np.eye(p) - block.diagonal_blocks(self._inverse[at, at])
                trace = np.linalg.solve(factor.T, np.linalg.solve(factor.T, lost).T)
            else:
                half = self._solved(self._lk[:, at])
                trace = block.diagonal_blocks(self._k[at, at])
                half = half.reshape(len(half) * block.levels, p)
                trace = trace - half.T @ half
            yield trace, scores[at].reshape(block.levels, p, -1)


# The (restricted) likelihood of crossed and nested random terms from cross-products, with its gradient.
#
# Model: y = X b + sum_t Z_t (I (x) L_t) u_t + e, u_t and e normal with SD sigma (`terms`). theta are the free
# entries of the L_t, relative to sigma, as in lme4 (Bates et al. 2015, doi:10.18637/jss.v067.i01). After the
# cross-products trials cost nothing. With V = I + Z L L'Z' over sigma^2, the grouping with the most
# coefficients is taken out first, which is a division by its p x p blocks; what is left, S = I + L'K L of the
# J other coefficients, is factored by Cholesky (`schur`).


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
    crossed: GroupingProducts = field(repr=False)
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
    blocks = blocks_of_terms(terms, at)
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
        grouping_products(z, rest, first.p),
        sparse.csr_matrix(rest.T @ rest),
        np.asarray(z.T @ b).reshape(first.levels, first.p, -1),
        np.asarray(rest.T @ b),
        b.T @ b,
    )


# Decision 0670: Mixed models eliminate the largest grouping first.
@dataclass(frozen=True)
class Criterion:
    """The model at one theta: deviance parts, estimates, and their derivatives.

    `h` = log|V|, with log|X'V^-1 X| for REML, `r2` the penalized residual sum of squares; `grad_h`, `grad_r2`
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
        # Where nothing is left over, r2 is rounding of either sign: the search then ends at no number.
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(self.h + self.nu * (1 + np.log(2 * np.pi * self.r2 / self.nu)))

    @property
    def gradient(self) -> Floats:
        """Gradient of `value`, (m,)."""
        return self.grad_h + self.nu * self.grad_r2 / self.r2


def criterion(c: CrossProducts, theta: Floats, reml: bool = True) -> Criterion:
    """Evaluate the criterion and its exact gradient at theta (m,)."""
    f, lp = c.f, c.first.factor(theta)
    gl = c.pp @ lp
    # I + L'Z'Z L of each level: positive definite at every theta, zero included.
    mp = lp.T @ gl + np.eye(len(lp))
    vb = lp.T @ c.pb
    wb: Floats = np.asarray(np.linalg.solve(mp, vb), dtype=np.float64)
    out = c.crossed.eliminated(lp, mp, gl)
    rest = SchurComplement(c.rest, theta, c.cc, out, c.cb - out.to_rest(wb))
    xp = wb - out.from_rest(rest.solution)
    # [X y]'V^-1 [X y]: X'V^-1 X, X'V^-1 y and y'V^-1 y in one.
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
        # The restricted likelihood has log|X'V^-1 X|, which changes with theta as well.
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
