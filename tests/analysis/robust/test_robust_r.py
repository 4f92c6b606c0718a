"""Aligned ranks, permutations and trimmed means agree with R written apart: tests/golden/r/robust.R."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.long_csv import design_of
from analysis.robust import permutation_tests, rank_tests, trimmed_pairs
from analysis.within.anova import AnovaResult, linear_anova, within_anova
from analysis.within.between import Covariate, between_design
from analysis.within.cell_means import cell_table

GOLDEN = Path(__file__).parents[2] / "golden" / "r"


@pytest.fixture(scope="module")
def expected() -> dict[str, Any]:
    return json.loads((GOLDEN / "robust.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return pd.read_csv(GOLDEN / "robust.csv", dtype={"id": str})


def anova_of(rows: pd.DataFrame, between: list[str]) -> AnovaResult:
    cells = cell_table(rows, "id", "y", ["a", "b"])
    design = design_of(rows, "id", cells.participants, between, [])
    return linear_anova(cells.y, ["a", "b"], cells.levels, design)


def test_aligned_ranks(expected: dict[str, Any], rows: pd.DataFrame) -> None:
    ours = {frozenset(test.effect.split(":")): test for test in rank_tests(anova_of(rows, ["g"]))}
    assert len(ours) == len(expected["ranks"])
    for theirs in expected["ranks"]:
        test = ours[frozenset(theirs["effect"].split(":"))]
        for key in ("f_value", "df_effect", "df_error", "p_value"):
            assert getattr(test, key) == pytest.approx(theirs[key], rel=1e-8), (theirs["effect"], key)


def test_all_sign_flips(expected: dict[str, Any], rows: pd.DataFrame) -> None:
    ours = {test.effect: test for test in permutation_tests(anova_of(rows[rows["id"] <= "p08"], []))}
    for theirs in expected["flips"]:
        test = ours[theirs["effect"]]
        assert (test.exact, test.flips, test.n_rearranged) == (True, True, 256)
        assert test.p_value == pytest.approx(theirs["p_value"], abs=1e-12)


def test_all_orders_with_a_covariate(expected: dict[str, Any], rows: pd.DataFrame) -> None:
    means = rows[rows["id"] <= "p07"].groupby(["id", "g"], as_index=False)["y"].mean()
    x = np.array(expected["lane"]["x"], dtype=float)
    codes = (means["g"] == "g2").to_numpy().astype(np.int64)[:, None]
    design = between_design(["g"], [["g1", "g2"]], codes, [Covariate("x", x, float(x.mean()))])
    result = linear_anova(means["y"].to_numpy(), [], None, design)
    test = next(test for test in permutation_tests(result) if test.effect == "g")
    assert (test.exact, test.flips, test.n_rearranged) == (True, False, 5040)
    assert test.f_value == pytest.approx(expected["lane"]["f_value"], rel=1e-8)
    assert test.p_value == pytest.approx(expected["lane"]["p_value"], abs=1e-12)


def test_trimmed_pairs(expected: dict[str, Any], rows: pd.DataFrame) -> None:
    ours = [pair for pair in trimmed_pairs(anova_of(rows, [])) if pair.effect == "a"]
    for pair, theirs in zip(ours, expected["pairs"], strict=True):
        for key, value in theirs.items():
            assert getattr(pair, key) == pytest.approx(value, rel=1e-8), key


def test_groups_are_compared_as_scipy_does(rows: pd.DataFrame) -> None:
    from scipy.stats import ttest_ind

    result = anova_of(rows, ["g"])
    people = result.y.mean(axis=(1, 2))
    first = result.between.codes[:, 0] == 0
    theirs = ttest_ind(people[first], people[~first], equal_var=False, trim=0.2)
    ours = next(pair for pair in trimmed_pairs(result) if pair.effect == "g")
    assert (ours.t, ours.df, ours.p) == pytest.approx((theirs.statistic, theirs.df, theirs.pvalue), rel=1e-9)


def test_without_trimming_it_is_the_paired_t_test(rows: pd.DataFrame) -> None:
    from analysis.within.pairwise import pairs_of

    result = anova_of(rows, [])
    ours = [(pair.t, pair.p, pair.df) for pair in trimmed_pairs(result, trim=0.0) if pair.effect == "a"]
    assert ours == [pytest.approx((pair.t, pair.p, pair.df)) for pair in pairs_of(result, ["a"])]


def test_drawn_flips_keep_their_level_where_nothing_differs() -> None:
    rng = np.random.default_rng(3)
    ps = []
    for seed in range(200):
        result = within_anova(rng.standard_t(3, size=(15, 4)), ["a"])
        ps.append(permutation_tests(result, n_random=199, seed=seed)[0].p_value)
    assert 0.01 <= np.mean(np.array(ps) <= 0.05) <= 0.11


def test_one_person_far_off_moves_the_means_and_not_the_trimmed_ones() -> None:
    rng = np.random.default_rng(5)
    y = rng.normal(4, 1, size=(20, 1)) + np.array([0.0, 0.8]) + rng.normal(0, 0.3, size=(20, 2))
    y[0, 0] += 40
    result = within_anova(y, ["a"])
    pair = trimmed_pairs(result)[0]
    assert result.effect("a").univariate.p_value > 0.2
    assert pair.p < 0.01
    assert pair.difference == pytest.approx(-0.8, abs=0.4)


@pytest.mark.parametrize("shift", [-1 / 3, 0.7])
def test_where_nothing_varies_after_winsorising_there_is_no_p(shift: float) -> None:
    y = np.full((20, 2), 10 / 3)
    y[:, 1] -= shift
    y[:4, 0] += np.array([3.0, -2.0, 1.0, -1.0])
    y[4:8] += np.arange(4)[:, None] / 7
    y[8:12] -= np.arange(4)[:, None] / 7
    (pair,) = trimmed_pairs(within_anova(y, ["a"]), trim=0.4)
    assert np.isnan(pair.p)
    assert np.isnan(pair.p_holm)


def test_groups_that_do_not_vary_have_no_p() -> None:
    y = np.repeat([10 / 3, 11 / 3], 10)
    design = between_design(["g"], [["u", "v"]], np.repeat([0, 1], 10)[:, None])
    (pair,) = trimmed_pairs(linear_anova(y, [], None, design))
    assert np.isnan(pair.p)


def test_the_report_prints_dashes_for_a_group_of_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    lines = [f"{p},{a},{'g' if p else 'h'},{rng.normal():.3f}" for p in range(7) for a in ("a0", "a1")]
    (tmp_path / "one.csv").write_text("id,A,group,score\n" + "\n".join(lines) + "\n", encoding="utf-8")
    roles = "--participant id --rating score --within A --between group --robust"
    ran = CliRunner().invoke(app, ["anova", str(tmp_path / "one.csv"), *roles.split()])
    assert ran.exit_code == 0, ran.output
    trimmed = ran.output.split("Pairs of means trimmed")[1]
    row = next(line for line in trimmed.splitlines() if line.startswith("group: g - h"))
    assert row.split()[-5:] == ["–"] * 5
