"""QUEST+ by the library: it finds known thresholds, and equal answers give equal choices."""

import random
import subprocess
import sys
from statistics import NormalDist

import pytest

from experiments.kinds.threshold_grid import Model, Point
from server.participation import quest

STIMULI = tuple(float(value) for value in range(50, 401, 25))


def model(function: str = "normal", *, falling: bool = False, guess: float = 0.02) -> Model:
    spreads = (
        tuple(10.0 * step for step in range(1, 11))
        if function == "normal"
        else tuple(map(float, range(1, 11)))
    )
    thresholds = tuple(50 + 10.0 * step for step in range(36))
    return Model(function, falling, STIMULI, thresholds, spreads, guess, 0.02)  # type: ignore[arg-type]


def answered(assumed: Model, truth: float, trials: int, seed: int) -> quest.Answers:
    """A series with an observer whose function is the normal one of this mean and SD 30."""
    rng, said = random.Random(seed), ()
    for _ in range(trials):
        stimulus = quest.choices(assumed, said, 1)[0]
        z = (stimulus.value - truth) / 30 * (-1 if assumed.falling else 1)
        likely = assumed.guess + (1 - assumed.guess - assumed.lapse) * NormalDist().cdf(z)
        said = (*said, (stimulus, rng.random() < likely))
    return said


@pytest.mark.parametrize(("falling", "guess"), [(False, 0.02), (True, 0.02), (False, 0.5)])
@pytest.mark.parametrize("truth", [150.0, 280.0])
def test_a_true_threshold_lies_within_three_standard_errors(
    falling: bool, guess: float, truth: float
) -> None:
    assumed = model(falling=falling, guess=guess)
    found = quest.estimate(assumed, answered(assumed, truth, 40, seed=3))
    assert abs(found.threshold - truth) < 3 * found.threshold_sd
    assert found.threshold_sd < 40
    assert found.entropy < quest.estimate(assumed, ()).entropy


def test_the_estimates_of_many_observers_have_no_bias_and_the_error_they_state() -> None:
    assumed = model()
    found = [quest.estimate(assumed, answered(assumed, 200.0, 25, seed)) for seed in range(12)]
    errors = [one.threshold - 200 for one in found]
    stated = sum(one.threshold_sd for one in found) / len(found)
    assert abs(sum(errors) / len(errors)) < 3 * stated / len(errors) ** 0.5
    assert max(map(abs, errors)) < 4 * stated


def test_equal_answers_give_equal_choices_whatever_was_computed_before() -> None:
    assumed = model("weibull")
    said = answered(assumed, 200.0, 6, seed=1)
    before = (quest.choices(assumed, said, 3), quest.estimate(assumed, said))
    quest._states.clear()
    quest.choices(assumed, (), 2)
    assert (quest.choices(assumed, said, 3), quest.estimate(assumed, said)) == before


def test_choices_ahead_are_those_after_the_likelier_answers() -> None:
    assumed = model()
    one, two = quest.choices(assumed, (), 2)
    assert two in {quest.choices(assumed, ((one, said),), 1)[0] for said in (True, False)}


def on_a_grid(*, falling: bool = False, guess: float = 0.02) -> Model:
    thresholds, spreads = tuple(50 + 25.0 * step for step in range(15)), (15.0, 30.0, 60.0, 120.0)
    tilts = tuple(-200 + 50.0 * step for step in range(9))
    return Model(
        "normal", falling, STIMULI[::2], thresholds, spreads, guess, 0.02, (0.0, 0.5, 1.0, 2.0), tilts
    )


def answered_on_a_grid(assumed: Model, threshold: float, tilt: float, trials: int) -> quest.Answers:
    """A series with an observer whose threshold is a straight line over the second number, and SD 30."""
    rng, said = random.Random(5), ()
    for _ in range(trials):
        point = quest.choices(assumed, said, 1)[0]
        z = (point.value - threshold - tilt * (point.second - 1.0)) / 30 * (-1 if assumed.falling else 1)
        likely = assumed.guess + (1 - assumed.guess - assumed.lapse) * NormalDist().cdf(z)
        said = (*said, (point, rng.random() < likely))
    return said


@pytest.mark.parametrize(("falling", "guess"), [(False, 0.02), (True, 0.02), (False, 0.5)])
def test_with_a_second_factor_the_threshold_at_its_middle_and_the_tilt_are_found(
    falling: bool, guess: float
) -> None:
    assumed = on_a_grid(falling=falling, guess=guess)
    said = answered_on_a_grid(assumed, 225.0, 100.0, 60 if guess < 0.5 else 110)
    found = quest.estimate(assumed, said)
    assert abs(found.threshold - 225) < 3 * found.threshold_sd
    assert found.threshold_sd < 30
    # The tilt is not stored, but the choice rests on it: the ends of the second factor are shown most.
    ends = [point.second for point, _ in said if point.second in (0.0, 2.0)]
    assert len(ends) > len(said) / 2
    engine = quest._engine(assumed)
    engine.posterior = quest._states[assumed, said].posterior
    tilt = engine.param_estimate["tilt"] * (-1 if falling else 1)
    assert abs(tilt - 100) < 50


def test_the_function_of_two_variables_is_eq_1_at_every_point() -> None:
    assumed = on_a_grid()
    table = quest._engine(assumed).likelihoods.squeeze()
    rng = random.Random(3)
    for _ in range(40):
        x, z = rng.choice(assumed.stimuli), rng.choice(assumed.seconds)
        t, b, s = rng.choice(assumed.thresholds), rng.choice(assumed.tilts), rng.choice(assumed.spreads)
        stated = table.sel(intensity=x, second=z, mean=t, tilt=b, sd=s, response="yes").item()
        assert stated == pytest.approx(0.02 + 0.96 * NormalDist().cdf((x - t - b * (z - 1.0)) / s), abs=1e-12)


def test_where_the_function_falls_both_the_threshold_and_the_tilt_turn() -> None:
    rising, falling = on_a_grid(), on_a_grid(falling=True)
    said: quest.Answers = tuple(
        (Point(x, z), x > 230 + 100 * (z - 1)) for x in STIMULI[::2] for z in (0.0, 2.0)
    )
    turned: quest.Answers = tuple((point, not yes) for point, yes in said)
    one, other = quest.estimate(rising, said), quest.estimate(falling, turned)
    assert one.threshold == pytest.approx(other.threshold, abs=1)


def test_a_server_starts_without_it() -> None:
    code = "import server.app, sys; print({'questplus', 'xarray', 'numpy', 'pandas'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
