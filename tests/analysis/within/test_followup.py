"""Adjusted p values, trends, equivalence, intervals of dz, and simple effects by other routes."""

import numpy as np
import pytest
from pingouin import bayesfactor_ttest
from scipy import integrate, stats
from scipy.special import ndtr
from statsmodels.stats.multitest import multipletests

from analysis.within.adjustments import bonferroni, false_discovery_rate, holm, range_tail, sidak, tukey
from analysis.within.anova import linear_anova, within_anova
from analysis.within.between import between_design
from analysis.within.contrast_tests import contrasts_of, equivalence, polynomial_weights, trends
from analysis.within.pairwise import PRIOR_SCALE, one_factor_pairs, pairs_of
from analysis.within.simple_effects import first_p, reports_multivariate, simple_effect, simple_effects
from experiments.errors import InputError

RNG = np.random.default_rng(5)
Y = (
    RNG.normal(size=(14, 1, 1))
    + RNG.normal(size=(14, 4, 3))
    + np.arange(4)[:, None] * np.array([0, 0.7, 1.4])
)
RESULT = within_anova(Y, ["duration", "face"], [["7", "9", "11", "15"], ["a", "b", "c"]])


@pytest.mark.parametrize(
    ("ours", "name"),
    [(bonferroni, "bonferroni"), (holm, "holm"), (sidak, "sidak"), (false_discovery_rate, "fdr_bh")],
)
def test_adjustments_agree_with_statsmodels(ours, name) -> None:
    p = np.array([0.001, 0.2, 0.03, 0.9, 0.03, 0.0004])
    assert ours(p) == pytest.approx(multipletests(p, method=name)[1], rel=1e-12)


@pytest.mark.parametrize(("k", "df"), [(3, 5), (4, 31), (10, 60)])
def test_tukey_agrees_with_the_studentized_range(k, df) -> None:
    t = np.array([0.0, 0.5, 2.0, 3.5])
    assert tukey(t, k, df) == pytest.approx(stats.studentized_range.sf(np.sqrt(2) * t, k, df), abs=1e-9)


@pytest.mark.parametrize("df", [1, 3, 17, 400])
def test_tukey_of_two_means_is_the_t_test(df) -> None:
    t = np.array([0.01, 0.5, 2.1, 8, 25])
    assert tukey(t, 2, df) == pytest.approx(2 * stats.t.sf(t, df), rel=1e-10, abs=1e-60)


@pytest.mark.parametrize("k", [3, 6, 60])
def test_tukey_with_a_known_error_is_the_range_of_normal_values(k) -> None:
    """Its lower tail by scipy's quadrature of the density of the range, where both have digits."""
    w = np.array([0.5, 2.0, 4.0, 6.0])
    below = [
        integrate.quad(lambda z, one=one: k * stats.norm.pdf(z) * (ndtr(z) - ndtr(z - one)) ** (k - 1), -9,
                       15, epsabs=1e-13, limit=200)[0]
        for one in w
    ]  # fmt: skip
    assert range_tail(w, k) == pytest.approx(1 - np.array(below), abs=1e-10)
    assert tukey(w / np.sqrt(2), k, 10**7) == pytest.approx(range_tail(w, k), rel=1e-5)


def test_tukey_of_no_number_is_none() -> None:
    assert np.isnan(tukey(np.array([np.nan, 1.0]), 3, 5)).tolist() == [True, False]


def test_tukey_where_ptukey_has_a_third_too_little() -> None:
    """q = 35.4 of six means on 3 df: R's own tail of a known error, integrated over the error by R 4.2.2.

    `integrate(function(u) ptukey(25 * sqrt(2 * qchisq(u, 3) / 3), 6, Inf, lower.tail = FALSE), 0, 1)`, in
    log s with relative tolerance 1e-9: 0.00068249594; `ptukey` itself 0.00087705.
    """
    assert tukey(np.array([25.0]), 6, 3) == pytest.approx([0.00068249594], rel=1e-7)


def test_simple_effects_within_are_one_way_anovas_of_the_slice() -> None:
    ours = simple_effect(RESULT, "duration", {"face": "b"})
    alone = within_anova(Y[:, :, 1], ["duration"]).effects[0]
    assert ours.univariate.f_value == pytest.approx(alone.univariate.f_value, rel=1e-10)
    assert ours.univariate.p_gg == pytest.approx(alone.univariate.p_gg, rel=1e-10)
    assert ours.multivariate.f_value == pytest.approx(alone.multivariate.f_value, rel=1e-10)


def test_significant_interactions_are_taken_apart_both_ways_with_holm() -> None:
    assert first_p(RESULT.effect("duration:face"), reports_multivariate(RESULT)) < 0.05
    found = simple_effects(RESULT)
    assert [(s.of, tuple(s.at.values())) for s in found][:3] == [("duration", (f,)) for f in "abc"]
    assert len(found) == 3 + 4
    assert [s.p_holm for s in found[:3]] == pytest.approx(holm(np.array([s.p_value for s in found[:3]])))
    with pytest.raises(InputError, match="not an interaction"):
        simple_effects(RESULT, ("face",))


def test_trends_use_the_spacing_of_the_levels() -> None:
    found = {c.name: c for c in trends(RESULT)}
    assert set(found) == {"linear", "quadratic", "cubic"}
    x = np.array([7, 9, 11, 15.0])
    slope = ((x - x.mean()) / np.linalg.norm(x - x.mean())) @ Y.mean(axis=2).T
    t = stats.ttest_1samp(slope, 0)
    assert found["linear"].t == pytest.approx(t.statistic, rel=1e-10)
    assert found["linear"].p == pytest.approx(t.pvalue, rel=1e-9)
    assert polynomial_weights([1, 2, 3]) == pytest.approx(
        np.array([[-1, 0, 1], [1, -2, 1]]) / np.sqrt([[2], [6]]), abs=1e-12
    )


def test_a_trend_that_is_the_same_in_everybody_has_no_t() -> None:
    """Its error is rounding, and t would be a number of 10^15."""
    constant = np.array([0.1, 0.7, 1.3, 1.9]) + np.arange(8)[:, None] / 7
    linear, *rest = trends(within_anova(constant, ("duration",), (("1", "2", "3", "4"),)))
    assert (linear.se, np.isnan(linear.t), np.isnan(linear.p)) == (0.0, True, True)
    assert all(one.se == 0.0 and np.isnan(one.t) for one in rest)


def test_contrasts_must_sum_to_zero_and_fit() -> None:
    with pytest.raises(InputError, match="sum to zero"):
        contrasts_of(RESULT, "face", [("x", [1, 1, -1])])
    with pytest.raises(InputError, match="2 weights for 3 levels"):
        contrasts_of(RESULT, "face", [("x", [1, -1])])


def test_equivalence_is_two_one_sided_t_tests() -> None:
    pair = pairs_of(RESULT, ["face"])[0]
    (ours,) = equivalence([pair], -0.5, 0.7)
    d = Y.mean(axis=1)[:, 0] - Y.mean(axis=1)[:, 1]
    assert ours.p_lower == pytest.approx(stats.ttest_1samp(d, -0.5, alternative="greater").pvalue, rel=1e-9)
    assert ours.p_upper == pytest.approx(stats.ttest_1samp(d, 0.7, alternative="less").pvalue, rel=1e-9)
    assert ours.p == max(ours.p_lower, ours.p_upper)


def test_the_interval_of_a_difference_of_exactly_zero_is_that_of_a_t_of_zero() -> None:
    y = np.array([[1.0, 2.0], [2.0, 1.0], [4.0, 2.0], [2.0, 4.0], [3.0, 3.0]])
    (pair,) = pairs_of(within_anova(y, ["face"], [["a", "b"]]), ["face"])
    assert pair.t == 0
    low, high = pair.dz_ci
    assert (low, high) == pytest.approx((-high, high))
    assert stats.nct.cdf(0.0, 4, high * np.sqrt(5)) == pytest.approx(0.025, abs=1e-9)


def test_bayes_factors_of_pairs_are_those_of_their_t_tests() -> None:
    by_level = dict(zip("abc", Y.mean(axis=1).T, strict=True))
    for pair in pairs_of(RESULT, ["face"]):
        t = stats.ttest_rel(by_level[pair.level_a], by_level[pair.level_b]).statistic
        theirs = bayesfactor_ttest(t, 14, paired=True, r=PRIOR_SCALE)
        assert pair.bayes_factor == pytest.approx(float(theirs), rel=1e-6)


def test_bayes_factors_of_unequal_groups_are_those_of_two_samples() -> None:
    design = between_design(["group"], [["u", "v"]], np.repeat([[0], [1]], [9, 5], axis=0))
    result = linear_anova(Y, ["duration", "face"], None, design)
    pair = next(p for p in one_factor_pairs(result) if p.effect == "group")
    theirs = bayesfactor_ttest(pair.t, 9, 5, r=PRIOR_SCALE)
    assert pair.bayes_factor == pytest.approx(float(theirs), rel=1e-6)


def test_the_interval_of_dz_puts_t_at_both_tails() -> None:
    for pair in one_factor_pairs(RESULT):
        low, high = (bound * np.sqrt(14) for bound in pair.dz_ci)
        assert stats.nct.cdf(pair.t, pair.df, low) == pytest.approx(0.975, abs=1e-6)
        assert stats.nct.cdf(pair.t, pair.df, high) == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (["implied", "implied:other"], ["other:x", "x"]),
        (["1", "1:2"], ["2:3", "3"]),
        (["a", "a, b"], ["b, c", "c"]),
        (["a=1", "a"], ["b", "1, b"]),
        (['q"', "q"], ["x,", "x"]),
        (["a - b", "a"], ["c", "b - c"]),
    ],
)
def test_names_of_cells_tell_them_apart_whatever_the_levels_hold(first: list[str], second: list[str]) -> None:
    from analysis.plans.result import Labels

    rng = np.random.default_rng(7)
    y = rng.normal(size=(9, 2, 2))
    result = within_anova(y, ["one", "two"], [first, second])
    pairs = pairs_of(result, ["one", "two"])
    assert len(pairs) == 6
    assert len({(pair.level_a, pair.level_b) for pair in pairs}) == 6
    assert len({name for pair in pairs for name in (pair.level_a, pair.level_b)}) == 4
    assert len({Labels().pair(pair.cell_a, pair.cell_b) for pair in pairs}) == 6
    cells = {tuple(cell.items()) for pair in pairs for cell in (pair.cell_a, pair.cell_b)}
    assert cells == {(("one", a), ("two", b)) for a in first for b in second}
