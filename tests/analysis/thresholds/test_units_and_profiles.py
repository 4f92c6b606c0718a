"""Thresholds whatever the unit of x, and profiles that leave the valley in which they begin."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from analysis.thresholds.likelihood import CHI2_95, Likelihood, Trials
from analysis.thresholds.psychometric import fit_threshold

STEPS = np.arange(1.0, 10.0)
ANSWERS = Trials(STEPS, np.full(9, 20.0), np.array([0, 0, 2, 5, 9, 14, 18, 20, 20.0]))


@pytest.mark.parametrize(("unit", "start"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)])
def test_the_unit_and_origin_of_x_change_nothing_but_the_unit(unit: float, start: float) -> None:
    plain = fit_threshold(ANSWERS)
    other = fit_threshold(replace(ANSWERS, x=start + unit * STEPS))
    ends = (plain.threshold_ci.low, plain.threshold_ci.high)
    moved = (other.threshold_ci.low, other.threshold_ci.high)
    for one, two in zip((plain.threshold, *ends), (other.threshold, *moved), strict=True):
        assert one is not None
        assert two is not None
        assert (two - start) / unit == pytest.approx(one, rel=1e-7)
    assert plain.threshold_se is not None
    assert other.threshold_se is not None
    assert other.threshold_se / unit == pytest.approx(plain.threshold_se, rel=1e-6)
    assert other.spread / unit == pytest.approx(plain.spread, rel=1e-6)


def test_a_weibull_in_a_small_unit_is_the_same() -> None:
    plain, small = (
        fit_threshold(replace(ANSWERS, x=unit * STEPS), "weibull", 0.0, None) for unit in (1.0, 1e-4)
    )
    assert small.threshold / 1e-4 == pytest.approx(plain.threshold, rel=1e-7)
    assert small.spread == pytest.approx(plain.spread, rel=1e-6)


def test_an_end_of_a_profile_is_where_the_refitted_likelihood_has_fallen() -> None:
    """Few trials, guess .5: the spread that fits best far from the maximum is far from the best one."""
    x = np.array([1.0, 1.5, 2.2, 3.1, 9.0])
    trials = Trials(x, np.full(5, 6.0), np.array([3.0, 5, 5, 5, 6]))
    fit = fit_threshold(trials, guess=0.5)
    model = Likelihood(trials, "normal", 0.5, 0.0)
    low = fit.threshold_ci.low
    assert low is not None

    def loss(location: float) -> float:
        spreads = np.linspace(np.log(8e-4), np.log(400), 2001)
        values = [model.negative(np.array([location, one])) for one in spreads]
        near = spreads[int(np.argmin(values))]
        best = optimize.minimize_scalar(
            lambda one: model.negative(np.array([location, one])), bounds=(near - 0.01, near + 0.01)
        )
        return 2 * (fit.log_likelihood + float(best.fun)) - CHI2_95

    assert loss(low) == pytest.approx(0.0, abs=1e-4)
    assert loss(low + 3) < -0.02  # before the end the likelihood has not fallen as far


def test_an_end_between_the_last_step_and_the_bound_is_not_an_open_end() -> None:
    """R 4.2.2, nlminb from six starts and uniroot over the same likelihood: 8.46284 (2026-11-24)."""
    right = np.array([8.0, 6, 10, 10, 10, 12, 11, 11])
    fit = fit_threshold(Trials(np.arange(10.0, 81, 10), np.full(8, 12.0), right), "weibull", 0.5, None)
    assert fit.threshold_ci.low == pytest.approx(8.4628402532, rel=1e-5)
