"""The scales of a trial as results, reports and the analysis read them."""

from pathlib import Path

import pytest

from experiments.errors import InputError
from experiments.kinds import scale_called, scales_of
from experiments.load import load_experiment

REPOSITORY = Path(__file__).parents[3]


def test_the_one_scale_of_a_rating_is_found_and_has_its_range() -> None:
    (scale,) = scales_of(load_experiment("exp1"))
    assert (scale.name, scale.minimum, scale.maximum, scale.step) == ("rating", 1, 7, 1)
    assert (scale.type, scale.reverse, scale.not_applicable) == ("points", False, False)
    assert scale.question["en"] == "How natural was this blink?"
    assert [value for value in (0, 1, 1.5, 7, 8) if scale.admits(value)] == [1, 7]
    assert scale_called(load_experiment("exp1")) == scale


def test_a_scale_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(InputError, match="'exp1' has no scale 'ratin'; did you mean 'rating'"):
        scale_called(load_experiment("exp1"), "ratin")
    pairs = load_experiment(str(REPOSITORY / "experiments" / "pairs-demo.toml"))
    with pytest.raises(InputError, match="expected trials with a scale"):
        scale_called(pairs)
    assert scales_of(pairs) == ()
