"""What is left of the random terms once the largest is taken out: S = I + L'K L (J, J), factored whole."""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from analysis.models.crossing import Eliminated
from analysis.models.terms import Block

Floats = NDArray[np.float64]

WELL_CONDITIONED = 0.02
"""Relative SDs above this let Z'V^-1 Z be read off the inverse of S."""


class Rest:
    """The rest of the terms at one theta, by a dense Cholesky factor.

    K = Z'V_1^-1 Z (J, J) and `kb` = Z'V_1^-1 [X y] (J, m) are cross-products with the first term taken out.
    """

    def __init__(
        self,
        blocks: Sequence[Block],
        theta: Floats,
        cc: sparse.csr_matrix,
        out: Eliminated,
        kb: Floats,
    ) -> None:
        self._blocks = blocks
        self._factors = [block.factor(theta) for block in blocks]
        self._k: Floats = np.asarray(cc.toarray() - out.schur(), dtype=np.float64)
        self._kb = kb
        self._lk = self._left(self._k)
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
        """Of every term the sum over levels of Z'V^-1 Z (p, p), and Z'V^-1 [X y] (levels, p, m)."""
        scores = self._kb - self._k @ self.solution
        for block, factor in zip(self._blocks, self._factors, strict=True):
            at, p = block.columns, factor.shape[0]
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
