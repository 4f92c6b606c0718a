"""Cross-products of participants with items, dense where most pairs met, sparse where few did."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SPARSE_BELOW = 0.15
"""Share of participant x item pairs with a trial below which the cross-products are kept sparse."""


class Eliminated(Protocol):
    """Cross-products with the participants taken out, at one Lp; m is any number of columns."""

    def schur(self) -> Floats:
        """V'W (J, J) with V = Lp'P, W = M^-1 V, P the cross-products, M = I + Lp'Z'Z Lp."""

    def to_items(self, values: Floats) -> Floats:
        """V' values (J, m) of values (N, p, m)."""

    def from_items(self, values: Floats) -> Floats:
        """W values (N, p, m) of values (J, m)."""

    def plain(self, values: Floats) -> Floats:
        """P values (N, p, m) of values (J, m)."""

    def quadratic(self, inner: Floats) -> Floats:
        """Sum over participants of Q inner Q' (p, p), Q = P - Z'Z Lp W, inner (J, J) symmetric."""


class Crossing(Protocol):
    """Sums of random-effect columns over the trials of every participant and item, (N, p, J)."""

    @property
    def n_items(self) -> int:
        """J."""

    def eliminated(self, lp: Floats, mp: Floats, gl: Floats) -> Eliminated:
        """Take the participants out: Lp (p, p), M (N, p, p), Z'Z Lp (N, p, p)."""


def crossing(z: Floats, participant: Integers, item: Integers, people: int, items: int) -> Crossing:
    """Cross-products of z (n, p) by participant and item codes (n,)."""
    p = z.shape[1]
    rows = participant[:, None] * p + np.arange(p)
    columns = np.repeat(item, p)
    sums = sparse.csr_matrix((z.ravel(), (rows.ravel(), columns)), shape=(people * p, items))
    pairs = len(np.unique(participant * items + item))
    if pairs < SPARSE_BELOW * people * items:
        return SparseCrossing(sums, p)
    return DenseCrossing(np.asarray(sums.toarray(), dtype=np.float64).reshape(people, p, items))


@dataclass(frozen=True)
class DenseCrossing:
    """`sums` (N, p, J)."""

    sums: Floats = field(repr=False)

    @property
    def n_items(self) -> int:
        """J."""
        return int(self.sums.shape[2])

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
        items = self.v.shape[2]
        return np.asarray(self.v.reshape(-1, items).T @ self.w.reshape(-1, items))

    def to_items(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.v.reshape(-1, self.v.shape[2]).T @ values.reshape(-1, values.shape[2]))

    def from_items(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.w @ values)

    def plain(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.p @ values)

    def quadratic(self, inner: Floats) -> Floats:
        """See `Eliminated`."""
        q = self.p - self.gl @ self.w
        return summed_product(q @ inner, q)


def summed_product(a: Floats, b: Floats) -> Floats:
    """Sum over participants of a_i b_i', both (N, p, m)."""
    p = a.shape[1]
    return np.asarray(a.transpose(1, 0, 2).reshape(p, -1) @ b.transpose(1, 0, 2).reshape(p, -1).T)


@dataclass(frozen=True)
class SparseCrossing:
    """`sums` (N p, J): the p rows of a participant stand together."""

    sums: sparse.csr_matrix = field(repr=False)
    p: int

    @property
    def n_items(self) -> int:
        """J."""
        return int(self.sums.shape[1])

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

    def to_items(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.v.T @ values.reshape(-1, values.shape[2]))

    def from_items(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.w @ values).reshape(-1, self.p, values.shape[1])

    def plain(self, values: Floats) -> Floats:
        """See `Eliminated`."""
        return np.asarray(self.sums @ values).reshape(-1, self.p, values.shape[1])

    def quadratic(self, inner: Floats) -> Floats:
        """See `Eliminated`."""
        turned = np.asarray(self.q @ inner)
        total = np.empty((self.p, self.p))
        for b in range(self.p):
            rows = self.q[b :: self.p].tocoo()
            for a in range(self.p):
                total[a, b] = rows.data @ turned[a :: self.p][rows.row, rows.col]
        return total
