"""One model over all people of answers over two stimulus variables."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy import integrate, special, stats

from analysis.report.choice_tables import plane_tables
from analysis.thresholds.answers import Answers
from analysis.thresholds.plane import Plane, Points, fit_plane
from analysis.thresholds.plane_people import (
    MarginalLikelihood,
    PopulationPlane,
    fit_plane_population,
    fit_planes,
)
from experiments.errors import InputError

X, Z = (grid.ravel() for grid in np.meshgrid([150.0, 225.0, 300.0, 375.0, 450.0], [0.0, 1.0, 2.0]))
GUESS = LAPSE = 0.02


def people(count: int, trials: int, sd: float, tilt_sd: float = 0.0, seed: int = 1) -> list[Points]:
    """Everybody's answers: threshold 300 at z = 1, tilt 40, spread 50."""
    rng = np.random.default_rng(seed)
    n = np.full(X.size, float(trials))
    made = []
    for _ in range(count):
        at = 300 + sd * rng.normal() + (40 + tilt_sd * rng.normal()) * (Z - 1)
        p = GUESS + (1 - GUESS - LAPSE) * special.ndtr((X - at) / 50)
        made.append(Points(X, Z, n, rng.binomial(trials, p).astype(float)))
    return made


def together(every: Sequence[Points], **options: bool) -> Plane:
    n, k = (np.sum([getattr(one, part) for one in every], axis=0) for part in ("n", "k"))
    return fit_plane(Points(every[0].x, Z, n, k), "normal", GUESS, LAPSE, middle=1.0, **options)


@pytest.fixture(scope="module")
def differing() -> tuple[list[Points], PopulationPlane]:
    every = people(12, 6, 40, 15)
    return every, fit_plane_population(every, together(every))


def test_the_likelihood_is_the_integral_over_peoples_thresholds_and_tilts() -> None:
    """Against Simpson's rule on a fine grid, with a second implementation of equation (1)."""
    every = people(2, 3, 30, 10) + people(1, 3, 30, 10, seed=9)
    model = MarginalLikelihood(every, together(every))
    mu, tilt, spread, sd, tilt_sd = 290.0, 35.0, 45.0, 28.0, 12.0

    u, v = np.linspace(-7, 7, 281)[:, None, None], np.linspace(-7, 7, 141)[None, :, None]

    def of_person(one: Points) -> float:
        at = mu + sd * u + (tilt + tilt_sd * v) * (one.z - 1)
        p = GUESS + (1 - GUESS - LAPSE) * special.ndtr((one.x - at) / spread)
        likelihood = np.prod(p**one.k * (1 - p) ** (one.n - one.k), axis=-1)
        inside = likelihood * (stats.norm.pdf(u) * stats.norm.pdf(v))[..., 0]
        over_tilts = integrate.simpson(inside, x=v[0, :, 0], axis=1)
        return float(np.log(integrate.simpson(over_tilts, x=u[:, 0, 0])))

    expected = sum(of_person(one) for one in every)
    value, gradient = model.value(np.array([mu, tilt, *np.log([spread, sd, tilt_sd])]))
    assert value == pytest.approx(expected, abs=1e-3)
    theta = np.array([mu, tilt, *np.log([spread, sd, tilt_sd])])
    for part, h in enumerate([1e-2, 1e-2, 1e-4, 1e-4, 1e-4]):
        move = h * np.eye(5)[part]
        slope = (model.value(theta + move)[0] - model.value(theta - move)[0]) / (2 * h)
        assert gradient[part] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_people_who_differ_make_the_interval_wider_than_all_trials_do(
    differing: tuple[list[Points], PopulationPlane],
) -> None:
    every, fit = differing
    pooled = together(every)
    assert fit.threshold_ci.low is not None
    assert fit.threshold_ci.high is not None
    assert fit.threshold_ci.low < 300 < fit.threshold_ci.high
    assert pooled.threshold_ci.low is not None
    assert pooled.threshold_ci.high is not None
    width = fit.threshold_ci.high - fit.threshold_ci.low
    assert width > 2 * (pooled.threshold_ci.high - pooled.threshold_ci.low)
    assert 25 < fit.threshold_sd < 60
    assert fit.spread < pooled.spread
    assert fit.tilt_ci.low is not None
    assert fit.tilt_ci.high is not None
    assert 0 < fit.tilt_ci.low < 40 < fit.tilt_ci.high


def test_the_ends_lie_where_the_profile_has_fallen_by_the_quantile(
    differing: tuple[list[Points], PopulationPlane],
) -> None:
    every, fit = differing
    model = MarginalLikelihood(every, together(every))
    for part, interval in ((0, fit.threshold_ci), (1, fit.tilt_ci)):
        for end in (interval.low, interval.high):
            assert end is not None
            start = np.array([fit.threshold, fit.tilt, *np.log([fit.spread, fit.threshold_sd, fit.tilt_sd])])
            start[part] = end
            fall = 2 * (fit.log_likelihood - model.maximum(start, part)[1])
            assert fall == pytest.approx(stats.f.ppf(0.95, 1, 11), rel=0.02)


def test_people_who_are_alike_give_the_fit_over_all_trials() -> None:
    every = people(10, 12, 0)
    fit, pooled = fit_plane_population(every, together(every)), together(every)
    assert fit.threshold == pytest.approx(pooled.threshold, abs=2)
    assert fit.tilt == pytest.approx(pooled.tilt, abs=3)
    assert fit.threshold_sd < 12


def test_a_falling_function_is_the_rising_one_of_the_other_answers(
    differing: tuple[list[Points], PopulationPlane],
) -> None:
    every, rising = differing
    turned = [Points(one.x, one.z, one.n, one.n - one.k) for one in every]
    fit = fit_plane_population(turned, together(turned, falling=True))
    for name in ("threshold", "tilt", "spread", "threshold_sd", "tilt_sd"):
        assert getattr(fit, name) == pytest.approx(getattr(rising, name), rel=2e-3)
    assert fit.threshold_ci.low == pytest.approx(rising.threshold_ci.low, rel=2e-3)
    assert fit.tilt_ci.high == pytest.approx(rising.tilt_ci.high, rel=5e-3)


def test_two_people_are_not_a_population() -> None:
    every = people(2, 10, 10)
    with pytest.raises(InputError, match="3 people or more, got 2"):
        fit_plane_population(every, together(every))


def test_answers_that_place_no_threshold_of_their_own_count_and_are_reported() -> None:
    """One person whose answers switch without overlap has no fit, and is one of the population."""
    every = [*people(3, 8, 20), Points(X, Z, np.full(X.size, 3.0), np.where(X > 260, 3.0, 0.0))]
    rows = [
        (x, z, float(i < k), f"p{person}")
        for person, one in enumerate(every)
        for x, z, n, k in zip(*one, strict=True)
        for i in range(int(n))
    ]
    x, z, y, names = (np.array(column) for column in zip(*rows, strict=True))
    answers = Answers(x, y, names.astype(object), None, "answers", False, (), z)
    result = fit_planes(answers, "normal", GUESS, LAPSE, middle=1.0)
    assert [one.fit is None for one in result.people] == [False] * 3 + [True]
    assert result.population["all"].people == 4
    table = plane_tables(result, ("Duration", "Asymmetry"), "study")[0]
    assert [row[0] for row in table.rows] == [
        "all, 4 people",
        "all, all trials",
        "all, mean of 3 individual fits",
    ]
    assert "too narrow if people differ" in " ".join(table.notes)
