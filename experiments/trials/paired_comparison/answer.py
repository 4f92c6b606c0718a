"""What a participant answers to one pair."""

from collections.abc import Mapping
from typing import Any, Literal

from experiments.trials.declared import Answer

CODES = {"left": 1, "right": 2, "tie": 3}
"""The number of each answer, as its key has it and an attention check asks for it."""


class ComparisonAnswer(Answer):
    """The clip chosen, or a tie; None where the pair could not be shown.

    `left` is the first of two clips in turn, and the upper of two stacked ones.
    """

    kind: Literal["paired_comparison"]
    winner: Literal["left", "right", "tie"] | None
    arrangement: Literal["side_by_side", "stacked", "one_after_the_other"] | None = None
    """How the two were in fact shown, not as declared where two clips beside one another did not fit."""

    @property
    def given(self) -> bool:
        """True where a clip, or neither, was chosen."""
        return self.winner is not None


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer."""
    return CODES.get(payload["winner"])
