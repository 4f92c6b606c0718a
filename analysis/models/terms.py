"""Random terms: which coefficients differ between the levels of a grouping, and their relative factors."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

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
    """Where a term stands: `theta` among the parameters, `columns` among the rest (none if it is first)."""

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


def placed(terms: Sequence[Term], first: int) -> list[Block]:
    """The blocks of terms, with term `first` taken out and the others side by side in their order."""
    blocks, theta, column = [], 0, 0
    for k, term in enumerate(terms):
        size = 0 if k == first else term.size
        columns = slice(column, column + size)
        column += size
        blocks.append(Block(term.levels, term.patterns, slice(theta, theta + len(term.patterns)), columns))
        theta += len(term.patterns)
    return blocks
