"""Levene's test agrees with scipy on every cell and on participants' means."""

import numpy as np
import pytest
from scipy import stats

from analysis.within.anova import linear_anova, within_anova
from analysis.within.between import between_design
from analysis.within.homogeneity import levene_tests


def test_every_cell_and_the_means_agree_with_scipy() -> None:
    rng = np.random.default_rng(1)
    codes = np.array([0] * 5 + [1] * 8 + [2] * 6)[:, None]
    y = rng.normal(size=(19, 3)) * (1 + codes)
    result = linear_anova(y, ["a"], [["x", "y", "z"]], between_design(["g"], [["u", "v", "w"]], codes))
    tests = levene_tests(result)
    assert [t.where for t in tests] == ["means", "x", "y", "z"]
    for test, column in zip(tests, [y.mean(axis=1), *y.T], strict=True):
        theirs = stats.levene(*(column[codes[:, 0] == g] for g in range(3)), center="median")
        assert test.f_value == pytest.approx(theirs.statistic, rel=1e-10)
        assert test.p_value == pytest.approx(theirs.pvalue, rel=1e-10)


def test_without_groups_there_is_nothing_to_test() -> None:
    assert levene_tests(within_anova(np.random.default_rng(0).normal(size=(5, 3)), ["a"])) == ()
