"""Error bars without the differences between participants."""

import math

import pytest

from experiments.error_bars import within_participant_errors


def test_two_conditions_by_hand() -> None:
    # differences 1, 2, 3 have SD 1: SE = 1 / 2 / sqrt(3) * sqrt(2)
    assert within_participant_errors([[1, 2], [3, 5], [2, 5]]) == pytest.approx(
        [math.sqrt(2) / 2 / math.sqrt(3)] * 2
    )


def test_one_condition_and_one_participant() -> None:
    assert within_participant_errors([[1.0], [3.0]]) == pytest.approx([1.0])
    assert within_participant_errors([[1.0, 2.0]]) == []
