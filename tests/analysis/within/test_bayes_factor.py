"""Bayes factors of t tests: published values, pingouin's, and where they must tend to."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pingouin import bayesfactor_ttest

from analysis.within.pairwise import PRIOR_SCALE, bayes_factor


@pytest.mark.parametrize(("t", "n", "published"), [(2.03, 80, 1.56), (0.69, 100, 10.0)])
def test_published_evidence_for_the_null(t, n, published) -> None:
    """Rouder et al. (2009), r = 1: their example's t(79) = 2.03; about ten to one at N = 100 and t = 0.69."""
    assert 1 / bayes_factor(t, n, n - 1, 1.0) == pytest.approx(published, rel=0.01)


@given(st.floats(-15, 15), st.integers(2, 2000), st.floats(0.1, 2.0))
@settings(max_examples=60, deadline=None)
def test_as_pingouin(t, n, scale) -> None:
    ours, theirs = bayes_factor(t, n, n - 1, scale), bayesfactor_ttest(t, n, paired=True, r=scale)
    assert ours == pytest.approx(float(theirs), rel=1e-6)


def test_two_groups_as_pingouin() -> None:
    theirs = bayesfactor_ttest(3.5, 20, 30, r=PRIOR_SCALE)
    assert bayes_factor(3.5, 20 * 30 / 50, 48) == pytest.approx(float(theirs), rel=1e-8)


def test_without_a_t_there_is_none_and_a_huge_one_does_not_overflow() -> None:
    assert math.isnan(bayes_factor(float("nan"), 20, 19))
    assert bayes_factor(1e6, 500, 499) > 1e300
