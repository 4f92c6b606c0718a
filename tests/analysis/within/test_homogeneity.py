"""Levene's test agrees with scipy on every cell and on participants' means."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis.within.anova import linear_anova, within_anova
from analysis.within.between import between_design
from analysis.within.homogeneity import box_test, levene_tests


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


def test_box_m_agrees_with_its_definition_in_r() -> None:
    golden = Path(__file__).parents[2] / "golden" / "r"
    rows = pd.read_csv(golden / "box_m.csv")
    expected = json.loads((golden / "box_m.json").read_text(encoding="utf-8"))
    wide = rows.pivot(index=["id", "group"], columns=["A", "B"], values="score")
    codes = np.array([["abc".index(group)] for _, group in wide.index])
    y = wide.to_numpy().reshape(-1, 2, 2)
    result = linear_anova(
        y, ["A", "B"], [["x", "y"], ["m", "n"]], between_design(["group"], [["a", "b", "c"]], codes)
    )
    found = box_test(result)
    assert found is not None
    for key in ("m", "chi2", "df", "p_value"):
        assert getattr(found, key) == pytest.approx(expected[key], rel=1e-8), key
    few = linear_anova(
        y[::4], ["A", "B"], [["x", "y"], ["m", "n"]], between_design(["group"], [["a", "b", "c"]], codes[::4])
    )
    assert "more participants than cells" in str(box_test(few).reason)
    assert box_test(within_anova(y, ["A", "B"])) is None
