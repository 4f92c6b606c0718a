"""The keys of a [trial] whose kind is `clip_rating`."""

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, Translated
from experiments.errors import InputError
from experiments.trials.kind import TrialDeclaration

if TYPE_CHECKING:
    from experiments.definition import Experiment


class Scale(Declaration):
    """The rating scale: whole numbers from `minimum` to `maximum` with labelled ends."""

    minimum: int = 1
    maximum: int = 7
    question: Translated
    low: Translated
    high: Translated

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        if not 1 <= self.maximum - self.minimum <= 10:
            raise ValueError(f"expected 2 to 11 scale points, got {self.minimum} to {self.maximum}")
        return self


class ClipRating(TrialDeclaration):
    """The single-clip rating: start by key, one view (or `views`), answer after the clip's end.

    A mouse that has not moved since its last press chooses nothing until `pointer_delay_ms` have passed.
    """

    kind: Literal["clip_rating"] = "clip_rating"
    scale: Scale
    views: Annotated[int, Field(ge=1, le=10)] = 1
    start: Literal["key", "fixation"] = "key"
    fixation_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    confirm: bool = False
    comment: bool = False


def clip_rating_of(experiment: "Experiment") -> ClipRating:
    """The experiment's trial as a rating of single clips; InputError where it is of another kind."""
    if not isinstance(experiment.trial, ClipRating):
        raise InputError(
            f"this needs trials of the kind clip_rating, '{experiment.name}' has {experiment.trial.kind}"
        )
    return experiment.trial
