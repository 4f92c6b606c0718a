"""Sparse and dense cross-products give one and the same criterion."""

import numpy as np
import pytest

from analysis.models import reml as module
from analysis.models.reml import Term, criterion, cross_products, intercept_term

RNG = np.random.default_rng(3)
N = 300
PARTICIPANT, ITEM = RNG.integers(0, 40, N), RNG.integers(0, 25, N)
X = np.column_stack([np.ones(N), RNG.integers(0, 2, N) * 2.0 - 1])
Y = RNG.normal(size=N) + RNG.normal(size=40)[PARTICIPANT] + RNG.normal(size=25)[ITEM]
PATTERNS = np.stack([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])


def test_both_forms_agree(monkeypatch) -> None:
    monkeypatch.setattr(module, "MANY", 0)
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


def test_few_sums_stay_dense_however_many_are_zero() -> None:
    # twenty clips in every cell of a balanced design: only intercepts meet, and 1,280 numbers are few
    cells = np.array([[1.0, a, b, a * b] for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    people, clips, cell = (codes.ravel() for codes in np.indices((16, 20, 4)))
    patterns = np.stack([np.diag(one) for one in np.eye(4)])
    terms = [Term(people, 16, cells[cell], patterns), intercept_term(clips, 20)]
    sums = cross_products(cells[cell], np.arange(1280.0), terms).crossed
    assert isinstance(sums, module.DenseCrossing)
    assert (sums.sums == 0).mean() == 0.75
