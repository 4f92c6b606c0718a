"""Sparse and dense cross-products give one and the same criterion."""

import numpy as np
import pytest

from analysis.models import crossing as module
from analysis.models.reml import criterion, cross_products
from analysis.models.terms import Term, intercept_term

RNG = np.random.default_rng(3)
N = 300
PARTICIPANT, ITEM = RNG.integers(0, 40, N), RNG.integers(0, 25, N)
X = np.column_stack([np.ones(N), RNG.integers(0, 2, N) * 2.0 - 1])
Y = RNG.normal(size=N) + RNG.normal(size=40)[PARTICIPANT] + RNG.normal(size=25)[ITEM]
PATTERNS = np.stack([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])


def test_both_forms_agree(monkeypatch) -> None:
    found = []
    for limit in (0.0, 1.0):
        monkeypatch.setattr(module, "SPARSE_BELOW", limit)
        c = cross_products(X, Y, [Term(PARTICIPANT, 40, X, PATTERNS), intercept_term(ITEM, 25)])
        found.append((type(c.crossed).__name__, criterion(c, np.array([0.7, 0.3, 0.5]))))
    (dense_name, dense), (sparse_name, sparse) = found
    assert (dense_name, sparse_name) == ("DenseCrossing", "SparseCrossing")
    assert sparse.value == pytest.approx(dense.value, rel=1e-12)
    for name in ("gradient", "curve_at_zero", "unscaled", "beta"):
        assert getattr(sparse, name) == pytest.approx(getattr(dense, name), rel=1e-8, abs=1e-10), name
    for one, other in zip(sparse.terms_x, dense.terms_x, strict=True):
        assert one == pytest.approx(other, rel=1e-8, abs=1e-10)
