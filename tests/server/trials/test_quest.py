"""QUEST+ by the library: it finds known thresholds, and equal answers give equal choices."""

import random
import subprocess
import sys
from statistics import NormalDist

import pytest

from experiments.trials.threshold.grid import Model
from server.trials.series import quest

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
        z = (stimulus - truth) / 30 * (-1 if assumed.falling else 1)
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


def test_equal_answers_give_equal_choices_whatever_was_reckoned_before() -> None:
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


def test_a_server_starts_without_it() -> None:
    code = "import server.app, sys; print({'questplus', 'xarray', 'numpy', 'pandas'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
