"""Means, pairs, trends and likelihood-ratio tests after models, against emmeans (tests/golden/r/means.R)."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.models.random_part import DfMethod, MixedResult
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "tests" / "golden" / "r"
GOLDEN = json.loads((FOLDER / "means.json").read_text(encoding="utf-8"))


def _crossed(df: DfMethod = "satterthwaite", **more: bool) -> MixedResult:
    rows = pd.read_csv(FOLDER / "crossed.csv")
    return fit_mixed(
        rows, "participant", "rating", ["blur"], "clip", "all", ["group"], ["age", "age:group"],
        df_method=df, **more,
    )  # fmt: skip


def _numbers(rows: list[Any], *names: str) -> list[list[float]]:
    return [[getattr(row, name) for row in rows] for name in names]


@pytest.mark.parametrize("df", ["satterthwaite", "kenward-roger"])
def test_means_and_pairs_of_the_mixed_model_agree_with_emmeans(df: DfMethod) -> None:
    result = _crossed(df, means=True).means
    assert result is not None
    for margin in GOLDEN[df.replace("-", "_")]:
        named = {":".join(m.levels.values()): m for m in result.means if m.margin == margin["margin"]}
        found = _numbers([named[cell] for cell in margin["cells"]], "estimate", "se", "df")
        np.testing.assert_allclose(found, [margin["estimate"], margin["se"], margin["df"]], rtol=2e-6)
        ends = np.array([named[cell].ci for cell in margin["cells"]])
        np.testing.assert_allclose(ends.T, [margin["low"], margin["high"]], rtol=2e-6)
        pairs = [p for p in result.pairs if p.margin == margin["margin"]]
        if ":" in margin["margin"]:
            # emmeans runs the first factor fastest
            assert len(pairs) == len(margin["p"])
            continue
        names = ("difference", "se", "df", "p_value", "p_bonferroni", "p_holm", "p_tukey")
        keys = ("difference", "pair_se", "pair_df", "p", "bonferroni", "holm", "tukey")
        expected = [np.atleast_1d(margin[key]) for key in keys]
        np.testing.assert_allclose(_numbers(pairs, *names), expected, rtol=5e-6)


@pytest.mark.parametrize("df", ["satterthwaite", "kenward-roger"])
def test_trends_of_covariates_agree_with_emtrends(df: DfMethod) -> None:
    result = _crossed(df, means=True).means
    assert result is not None
    expected = GOLDEN["trends"][df.replace("-", "_")]
    assert [trend.levels["group"] for trend in result.trends] == expected["level"]
    found = _numbers(list(result.trends), "estimate", "se", "df")
    np.testing.assert_allclose(found, [expected["slope"], expected["se"], expected["df"]], rtol=1e-5)
    pair = result.trend_pairs[0]
    numbers = (expected["difference"], expected["pair_se"], expected["pair_df"], expected["p"])
    assert (pair.difference, pair.se, pair.df, pair.p_value) == pytest.approx(numbers, rel=1e-5)


def test_likelihood_ratio_tests_agree_with_r() -> None:
    tests = {test.effect: test for test in _crossed(likelihood_ratio=True).ratio_tests}
    assert set(tests) == {known["effect"] for known in GOLDEN["lrt"]}
    for known in GOLDEN["lrt"]:
        own = tests[known["effect"]]
        assert (own.chi2, own.df, own.p_value) == pytest.approx(
            (known["chi2"], known["df"], known["p"]), rel=1e-6
        )


def test_ordinal_means_and_tests_agree_with_emmeans() -> None:
    rows = pd.read_csv(FOLDER / "models" / "ordinal_three_levels.csv")
    factors = GOLDEN["ordinal_factors"]
    result = fit_ordinal(
        rows, "participant", "rating", factors, "clip", quadrature=1, means=True, likelihood_ratio=True
    )
    assert result.means is not None
    for margin in GOLDEN["ordinal"]:
        means = [m for m in result.means.means if m.margin == margin["margin"]]
        # clmm stops earlier than we do, by 1e-5 of a coefficient
        np.testing.assert_allclose([m.estimate for m in means], margin["estimate"], atol=3e-5)
        np.testing.assert_allclose([m.se for m in means], margin["se"], rtol=5e-5)
        pairs = [p for p in result.means.pairs if p.margin == margin["margin"]]
        np.testing.assert_allclose(
            [p.difference for p in pairs], np.atleast_1d(margin["difference"]), atol=3e-5
        )
        np.testing.assert_allclose([p.p_tukey for p in pairs], np.atleast_1d(margin["tukey"]), rtol=2e-4)
        assert all(np.isinf(p.df) for p in pairs)
    for own, known in zip(result.ratio_tests, GOLDEN["ordinal_lrt"], strict=True):
        assert (own.effect, own.df) == (known["effect"], known["df"])
        assert (own.chi2, own.p_value) == pytest.approx((known["chi2"], known["p"]), rel=1e-6)


def test_a_slope_that_is_the_same_everywhere_has_no_levels() -> None:
    rows = pd.read_csv(FOLDER / "crossed.csv")
    result = fit_mixed(
        rows, "participant", "rating", ["blur"], "clip", "none", covariates=["age"], means=True
    )
    assert result.means is not None
    assert [trend.levels for trend in result.means.trends] == [{}]
    own = next(one for one in result.coefficients if one.name == "age")
    trend = result.means.trends[0]
    assert (trend.estimate, trend.se, trend.df) == pytest.approx((own.estimate, own.se, own.df), rel=1e-10)
    assert result.means.trend_pairs == ()
    plain = fit_mixed(rows, "participant", "rating", ["blur"], "clip", "none", covariates=["age"])
    assert replace(result, means=None) == plain


def test_commands_add_means_and_tests(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    named = ["--participant", "participant", "--rating", "rating", "--item", "clip", "--json", str(out)]
    more = ["--means", "--likelihood-ratio"]
    runner = CliRunner()
    mixed = ["mixed", str(FOLDER / "crossed.csv"), *named, "--within", "blur", "--between", "group"]
    ended = runner.invoke(app, [*mixed, *more])
    assert ended.exit_code == 0, ended.output
    for title in ("Marginal means", "Pairs of means and slopes", "Likelihood-ratio tests"):
        assert title in ended.output
    assert len(json.loads(out.read_text(encoding="utf-8"))["means"]["pairs"]) == 1 + 3 + 15
    file = FOLDER / "models" / "ordinal_three_levels.csv"
    ended = runner.invoke(app, ["ordinal", str(file), *named, "--within", "A,B", *more])
    assert ended.exit_code == 0, ended.output
    assert "On the logit scale, from the mean of the thresholds." in ended.output.replace("\n  ", " ")


def test_equivalence_of_means_of_two_ratings_each_is_that_of_the_paired_t(tmp_path: Path) -> None:
    """One rating of each person in each of two conditions: the model's test is the paired t test."""
    random = np.random.default_rng(5)
    y = random.normal(size=(14, 1)) + random.normal(size=(14, 2)) + [0.0, 0.2]
    rows = [f"p{p:02d},{'ab'[c]},{value}" for (p, c), value in np.ndenumerate(y)]
    path, out = tmp_path / "r.csv", tmp_path / "r.json"
    path.write_text("\n".join(["id,cond,score", *rows]) + "\n", encoding="utf-8")
    base = ["mixed", str(path), "--formula", "score ~ cond + (1 | id)", "--json", str(out)]
    ended = CliRunner().invoke(app, [*base, "--means", "--equivalence", "-0.9,1.2"])
    assert ended.exit_code == 0, ended.exception
    assert "p (TOST)" in ended.stdout
    (pair,) = json.loads(out.read_text(encoding="utf-8"))["means"]["pairs"]
    d = y[:, 0] - y[:, 1]
    above = stats.ttest_1samp(d, -0.9, alternative="greater").pvalue
    below = stats.ttest_1samp(d, 1.2, alternative="less").pvalue
    assert pair["p_equivalence"] == pytest.approx(max(above, below), rel=1e-5)
    ended = CliRunner().invoke(app, [*base, "--equivalence", "0.5"])
    assert "--equivalence tests pairs of marginal means: add --means" in str(ended.exception)
