"""Cross-products of the grouping taken out first with all others, dense where most met, sparse where few did.

N levels with p columns each are taken out; J is the number of columns of the rest.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]

SPARSE_BELOW = 0.15
"""Share of cross-products other than zero below which they are kept sparse, where they are many."""

MANY = 100_000
"""N p J^2 / p^2 from which sparse products, p^2 of which are waited for, may be faster than dense ones."""


class Eliminated(Protocol):
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


class Crossing(Protocol):
    """Cross-products of random-effect columns, (N, p, J)."""

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> Eliminated:
        """Take the first grouping out: Lp (p, p), M (N, p, p), Z'Z Lp (N, p, p)."""


def crossing(first: sparse.csr_matrix, rest: sparse.csr_matrix, p: int) -> Crossing:
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
        """See `Crossing`."""
        v = lp.T @ self.sums
        return DenseEliminated(self.sums, v, np.asarray(np.linalg.solve(mp, v), dtype=np.float64), gl)


@dataclass(frozen=True)
class DenseEliminated:
    """See `Eliminated`."""

    p: Floats = field(repr=False)
    v: Floats = field(repr=False)
    w: Floats = field(repr=False)
    gl: Floats = field(repr=False)

    def schur(self) -> Floats:
        """See `Eliminated`."""
        return np.asarray(_flat(self.v).T @ _flat(self.w))

    def to_rest(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(_flat(self.v).T @ _flat(values))

    def from_rest(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.w @ values)

    def plain(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.p @ values)

    def quadratic(self, inner: Floats) -> Floats:
        """See `Eliminated`."""
        q = self.p - self.gl @ self.w
        return summed_product(q @ inner, q)


def _flat(values: Floats) -> Floats:
    """(N p, m) of (N, p, m), also where m is 0."""
    n, p, width = values.shape
    return values.reshape(n * p, width)


def summed_product(a: Floats, b: Floats) -> Floats:
    """Sum over levels of a_i b_i', both (N, p, m)."""
    n, p, width = a.shape
    turned = (values.transpose(1, 0, 2).reshape(p, n * width) for values in (a, b))
    return np.asarray(next(turned) @ next(turned).T)


@dataclass(frozen=True)
class SparseCrossing:
    """`sums` (N p, J): the p rows of a level stand together."""

    sums: sparse.csr_matrix = field(repr=False)
    p: int

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> "SparseEliminated":
        """See `Crossing`."""
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
    """See `Eliminated`."""

    sums: sparse.csr_matrix = field(repr=False)
    v: sparse.csr_matrix = field(repr=False)
    w: sparse.csr_matrix = field(repr=False)
    q: sparse.csr_matrix = field(repr=False)
    p: int

    def schur(self) -> Floats:
        """See `Eliminated`."""
        return np.asarray((self.v.T @ self.w).toarray(), dtype=np.float64)

    def to_rest(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.v.T @ values.reshape(-1, values.shape[2]))

    def from_rest(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.w @ values).reshape(-1, self.p, values.shape[1])

    def plain(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.sums @ values).reshape(-1, self.p, values.shape[1])

    def quadratic(self, inner: Floats) -> Floats:
        """See `Eliminated`."""
        columns = [self.q[a :: self.p] for a in range(self.p)]
        total = np.empty((self.p, self.p))
        for a in range(self.p):
            for b in range(a + 1):
                both = sparse.coo_matrix(columns[a].T @ columns[b])
                total[a, b] = total[b, a] = both.data @ inner[both.row, both.col]
        return total
