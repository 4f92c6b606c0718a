"""The declaration of continuous ratings and what is stored of an answer."""

from pathlib import Path

import pytest

from experiments.declaration.continuous_rating import MAX_SAMPLES, ContinuousAnswer, samples_of, step_frames
from experiments.errors import InputError
from experiments.kinds.continuous_rating import CONTINUOUS_RATING
from experiments.load import load_experiment, parse_experiment
from tests.helpers.studies import SHORT

REPOSITORY = Path(__file__).resolve().parents[3]
TEXT = SHORT[: SHORT.index("[trial]")] + CONTINUOUS_RATING.example + SHORT[SHORT.index("[[exclusions]]") :]


def test_samples_are_as_many_as_fit() -> None:
    assert [step_frames(30, 10), step_frames(25, 10), step_frames(24, 30)] == [3, 3, 1]
    assert [samples_of(frames, 3) for frames in (1, 3, 4, 300)] == [1, 1, 2, 100]
    assert samples_of(60 * 60, step_frames(60, 30)) == MAX_SAMPLES


def test_its_answer_is_stored_with_its_mean() -> None:
    answer = ContinuousAnswer(kind="continuous_rating", values=(1.0, 2.0, 4.0), step_frames=3)
    assert answer.stored()["response"] == 2.3333
    assert answer.given
    assert not ContinuousAnswer(kind="continuous_rating").given
    assert ContinuousAnswer(kind="continuous_rating", chosen=4).stored()["response"] == 4


def test_a_range_the_wrong_way_round_is_refused() -> None:
    with pytest.raises(InputError, match="expected a maximum above the minimum, got 0 to -1"):
        parse_experiment(TEXT.replace("maximum = 100.0", "maximum = -1.0"))


def test_the_shipped_study_loads() -> None:
    assert load_experiment(str(REPOSITORY / "experiments" / "timing-continuous.toml")).trial
