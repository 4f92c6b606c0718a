"""Adjusted p values, trends, equivalence, intervals of dz, and simple effects by other routes."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from analysis.within.adjustments import bonferroni, false_discovery_rate, holm, sidak, tukey
from analysis.within.anova import within_anova
from analysis.within.contrast_tests import contrasts_of, equivalence, polynomial_weights, trends
from analysis.within.pairwise import one_factor_pairs, pairs_of
from analysis.within.simple_effects import main_p, simple_effect, simple_effects
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


def test_tukey_of_two_means_is_the_t_test() -> None:
    assert tukey(np.array([2.1]), 2, 17) == pytest.approx(2 * stats.t.sf(2.1, 17), rel=1e-9)


def test_simple_effects_within_are_one_way_anovas_of_the_slice() -> None:
    ours = simple_effect(RESULT, "duration", {"face": "b"})
    alone = within_anova(Y[:, :, 1], ["duration"]).effects[0]
    assert ours.univariate.f_value == pytest.approx(alone.univariate.f_value, rel=1e-10)
    assert ours.univariate.p_gg == pytest.approx(alone.univariate.p_gg, rel=1e-10)
    assert ours.multivariate.f_value == pytest.approx(alone.multivariate.f_value, rel=1e-10)


def test_significant_interactions_are_taken_apart_both_ways_with_holm() -> None:
    assert main_p(RESULT.effect("duration:face")) < 0.05
    found = simple_effects(RESULT)
    assert [(s.of, tuple(s.at.values())) for s in found][:3] == [("duration", (f,)) for f in "abc"]
    assert len(found) == 3 + 4
    assert [s.p_holm for s in found[:3]] == pytest.approx(holm(np.array([s.p_value for s in found[:3]])))
    with pytest.raises(InputError, match="no interaction"):
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


def test_the_interval_of_dz_puts_t_at_both_tails() -> None:
    for pair in one_factor_pairs(RESULT):
        low, high = (bound * np.sqrt(14) for bound in pair.dz_ci)
        assert stats.nct.cdf(pair.t, pair.df, low) == pytest.approx(0.975, abs=1e-6)
        assert stats.nct.cdf(pair.t, pair.df, high) == pytest.approx(0.025, abs=1e-6)
