"""What a participant answers to one trial of a series."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt

from experiments.trials.declared import Answer

CODES = {"yes": 1, "no": 2, "first": 1, "second": 2}
"""The number of each answer, as its key has it and an attention check asks for it."""


class ThresholdAnswer(Answer):
    """The answer; None where the clips could not be shown."""

    kind: Literal["threshold"]
    chosen: Literal["yes", "no", "first", "second"] | None
    known: Annotated[StrictInt, Field(ge=0, le=100_000)] = 0
    """How many answers of the series the server's choice of this stimulus rested on, as it said."""

    @property
    def given(self) -> bool:
        """True where there is an answer."""
        return self.chosen is not None


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer."""
    return CODES.get(payload["chosen"])
