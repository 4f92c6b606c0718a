"""What a participant answers to one clip: a number at each of its sampled frames."""

from collections.abc import Mapping
from statistics import fmean
from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt

from experiments.trials.continuous_rating.declaration import CHECK_POINTS, MAX_SAMPLES
from experiments.trials.declared import Answer

Sample = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class ContinuousAnswer(Answer):
    """The answer; no values where the clip could not be shown."""

    kind: Literal["continuous_rating"]
    values: Annotated[tuple[Sample, ...], Field(min_length=1, max_length=MAX_SAMPLES)] | None = None
    """The slider's place at frames 0, `step_frames`, 2 `step_frames` and so on."""
    step_frames: Annotated[StrictInt, Field(ge=1, le=1000)] | None = None
    moves: Annotated[StrictInt, Field(ge=0, le=100_000)] = 0
    """How often the slider began to move."""
    chosen: Annotated[StrictInt, Field(ge=1, le=CHECK_POINTS)] | None = None
    """The number given to an attention check, which has no clip."""

    @property
    def given(self) -> bool:
        """True where there is an answer."""
        return self.values is not None or self.chosen is not None

    def stored(self) -> dict[str, Any]:
        """The payload, with `response`: the mean of the values, or the number chosen."""
        mean = None if self.values is None else round(fmean(self.values), 4)
        return {**super().stored(), "response": self.chosen if mean is None else mean}


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer to an attention check."""
    number: int | None = payload["chosen"]
    return number
