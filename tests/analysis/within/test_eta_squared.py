"""Effect sizes: the noncentral F interval against R's definition and known values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from analysis.within.strata import noncentrality, partial_eta_squared_ci


@settings(deadline=None, max_examples=80)
@given(
    st.floats(1e-3, 3000), st.integers(1, 24), st.integers(2, 600), st.sampled_from([0.975, 0.025, 0.95, 0.5])
)
def test_the_noncentrality_puts_f_at_the_wanted_tail(f, d1, d2, tail) -> None:
    size = float(noncentrality(np.array([f]), np.array([d1]), np.array([d2]), np.array([tail]))[0])
    if stats.f.cdf(f, d1, d2) <= tail:
        assert size == 0
    else:
        assert stats.ncf.cdf(f, d1, d2, size) == pytest.approx(tail, abs=1e-9)


def test_no_root_gives_zero_and_nan_gives_nan() -> None:
    ci = partial_eta_squared_ci(np.array([0.5, np.nan]), np.array([2.0, 2.0]), np.array([40.0, 40.0]))
    assert ci[0, 0] == 0
    assert 0 < ci[0, 1] < 0.2
    assert np.isnan(ci[1]).all()
