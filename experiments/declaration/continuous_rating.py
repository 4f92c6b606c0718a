"""Clips rated while they are shown: their [trial] and its answer."""

from collections.abc import Mapping
from statistics import fmean
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictInt, model_validator

from experiments.declaration.base import Translated
from experiments.declaration.trial import Answer, HasTrial, TrialDeclaration
from experiments.errors import InputError

# The keys of a [trial] whose kind is `continuous_rating`.

MAX_SAMPLES = 1800
"""Samples of one trace: 30 a second over a minute."""
CHECK_POINTS = 7
"""Attention checks ask for a number from 1 to this."""
Finite = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class ContinuousRating(TrialDeclaration):
    """A slider that is moved while the clip plays. Its position is sampled at frames of the clip."""

    kind: Literal["continuous_rating"] = "continuous_rating"
    """The kind of this trial."""
    question: Translated
    """The question, in every language."""
    low: Translated
    """Label of the low end."""
    high: Translated
    """Label of the high end."""
    minimum: Finite = 0.0
    """The number at the low end."""
    maximum: Finite = 100.0
    """The number at the high end."""
    input: Literal["slider", "keys"] = "slider"
    """`slider`: moved by pointer, or by arrow keys one step per press. `keys`: holding an arrow key also
    moves it, at constant speed."""
    seconds_across: Annotated[float, Field(ge=0.5, le=20)] = 3.0
    """Time in seconds that a held key takes from end to end; with `input = "keys"`."""
    sample_hz: Annotated[int, Field(ge=1, le=30)] = 10
    """Samples per second of the clip. The position is sampled at regular frames."""
    max_lag_s: Annotated[float, Field(gt=0, le=10)] = 3.0
    """Longest delay between clip and rating that the analysis considers, in seconds."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time in ms for which clicks are ignored if the mouse has not moved since its last click."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.maximum <= self.minimum:
            raise ValueError(
                f"expected a maximum above the minimum, got {self.minimum:g} to {self.maximum:g}"
            )
        for name, text in (("low", self.low), ("high", self.high)):
            if missing := sorted(set(self.question) - set(text)):
                raise ValueError(f"{name} has no text in '{missing[0]}', which the question has")
        return self

    def asked(self, language: str) -> str:
        """The question, the ends, and how often they are sampled."""
        low, high, question = (text.get(language, "") for text in (self.low, self.high, self.question))
        return (
            f"Rated while the clip is shown, {self.sample_hz} samples per second: {self.minimum:g} ({low}) "
            f"to "
            f"{self.maximum:g} ({high}). Question: {question}"
        )


def step_frames(fps: float, sample_hz: int) -> int:
    """Frames from one sample to the next of a clip of that rate."""
    # As the page rounds: halves up.
    return max(1, int(fps / sample_hz + 0.5))


def samples_of(frames: int, step: int) -> int:
    """Samples of a clip: at frames 0, `step`, 2 `step` and so on."""
    return (frames - 1) // step + 1


def continuous_rating_of(experiment: HasTrial) -> ContinuousRating:
    """The experiment's trial as a continuous rating; InputError where it is of another kind."""
    if not isinstance(experiment.trial, ContinuousRating):
        raise InputError(
            f"this needs trials of the kind continuous_rating, '{experiment.name}' has "
            f"{experiment.trial.kind}"
        )
    return experiment.trial


# The answer to one clip: a number at each of its sampled frames.

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
