"""Hessian of the joint density of ratings and crossed random effects, by blocks."""

import numpy as np
from numpy.typing import NDArray

from analysis.models.ordinal_data import OrdinalData

Floats = NDArray[np.float64]


class CrossedHessian:
    """H = I + L'WL of the crossed effects.

    Its blocks are A of participants (block diagonal), D of items (diagonal) and B between them. The larger
    of the two is eliminated, so that the one matrix inverted whole is the smaller one's Schur complement.
    """

    def __init__(self, data: OrdinalData, scaled: Floats, sd_item: float, weight: Floats) -> None:
        n, c, j = data.n_participants, data.z.shape[1], data.n_items
        self.shape = (n, c, j)
        a = np.empty((n, c, c))
        for row in range(c):
            for column in range(row + 1):
                w = weight * scaled[:, row] * scaled[:, column]
                a[:, row, column] = a[:, column, row] = np.bincount(data.participant, weights=w, minlength=n)
        a += np.eye(c)
        pair = data.participant * j + data.item
        b = np.stack([np.bincount(pair, weights=weight * z, minlength=n * j) for z in scaled.T], axis=1)
        self.b = sd_item * b.reshape(n, j, c).transpose(0, 2, 1).reshape(n * c, j)
        d = np.asarray(1 + sd_item**2 * np.bincount(data.item, weights=weight, minlength=j), np.float64)
        self.keeps_people = n * c <= j
        if self.keeps_people:
            self._eliminate_items(a, d)
        else:
            self._eliminate_people(a, d)

    def _eliminate_items(self, a: Floats, d: Floats) -> None:
        n, c, _ = self.shape
        self.d = d
        self.scaled_b: Floats = self.b / d
        schur: Floats = -self.scaled_b @ self.b.T
        for i in range(n):
            schur[i * c : (i + 1) * c, i * c : (i + 1) * c] += a[i]
        self.inverse = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(schur)[1] + np.log(d).sum())

    def _eliminate_people(self, a: Floats, d: Floats) -> None:
        n, c, j = self.shape
        self.a_inverse = np.linalg.inv(a)
        self.scaled_b = (self.a_inverse @ self.b.reshape(n, c, j)).reshape(n * c, j)
        schur = np.diag(d) - self.b.T @ self.scaled_b
        self.inverse = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(schur)[1] + np.linalg.slogdet(a)[1].sum())

    def solve(self, r_p: Floats, r_i: Floats) -> tuple[Floats, Floats]:
        """H^-1 of a vector of participants (people, c) and items (items,)."""
        n, c, _ = self.shape
        if self.keeps_people:
            people = self.inverse @ (r_p.ravel() - self.scaled_b @ r_i)
            return people.reshape(n, c), r_i / self.d - self.scaled_b.T @ people
        items = self.inverse @ (r_i - self.scaled_b.T @ r_p.ravel())
        alone = np.einsum("ncd,nd->nc", self.a_inverse, r_p)
        return alone - (self.scaled_b @ items).reshape(n, c), items

    def blocks(self) -> tuple[Floats, Floats, Floats]:
        """Of H^-1: blocks of participants (people, c, c), diagonal of items, cross (people, c, items)."""
        n, c, j = self.shape
        if self.keeps_people:
            people = np.stack([self.inverse[i * c : (i + 1) * c, i * c : (i + 1) * c] for i in range(n)])
            cross = -self.inverse @ self.scaled_b
            items = 1 / self.d - np.einsum("qj,qj->j", self.scaled_b, cross)
            return people, items, cross.reshape(n, c, j)
        cross = (-self.scaled_b @ self.inverse).reshape(n, c, j)
        people = self.a_inverse - np.einsum("ncj,ndj->ncd", cross, self.scaled_b.reshape(n, c, j))
        return people, np.diag(self.inverse), cross
