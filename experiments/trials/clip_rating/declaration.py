"""The keys of a [trial] whose kind is `clip_rating`."""

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, Translated
from experiments.errors import InputError
from experiments.trials.kind import TrialDeclaration
from experiments.trials.scales import RatedScale

if TYPE_CHECKING:
    from experiments.definition import Experiment

SCALE_NAME = "rating"
"""Name of the scale of a [trial.scale], which declares none."""


class Scale(Declaration):
    """The rating scale: whole numbers from `minimum` to `maximum` with labelled ends."""

    minimum: int = 1
    """Lowest point of the scale, a whole number."""
    maximum: int = 7
    """Highest point; with the lowest it makes 2 to 11 points."""
    question: Translated
    """What is asked, in every language."""
    low: Translated
    """Label of the lowest point."""
    high: Translated
    """Label of the highest point."""

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
    """Names this kind of trial."""
    scale: Scale
    """The question and its scale."""
    views: Annotated[int, Field(ge=1, le=10)] = 1
    """How often the clip is shown before it is rated."""
    start: Literal["key", "fixation"] = "key"
    """A clip begins on a key press, or by itself after a fixation cross."""
    fixation_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """How long the fixation cross stands before the clip, in ms; with `start = "fixation"`."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time, in ms, for which a mouse that has not moved since its last press chooses nothing."""
    confirm: bool = False
    """Whether a rating counts only once it is confirmed, so that it can be changed before."""
    comment: bool = False
    """Adds a line of free text beside the rating; it stands in the column `comment`."""

    def asked(self, language: str) -> str:
        """The scale's ends and the question."""
        scale = self.scale
        return (
            f"Scale: {scale.minimum} ({scale.low.get(language, '')}) to {scale.maximum} "
            f"({scale.high.get(language, '')}). Question: {scale.question.get(language, '')}"
        )

    def rated_scales(self) -> tuple[RatedScale, ...]:
        """The one scale."""
        scale = self.scale
        return (
            RatedScale(
                name=SCALE_NAME,
                type="points",
                minimum=scale.minimum,
                maximum=scale.maximum,
                step=1,
                reverse=False,
                not_applicable=False,
                question=scale.question,
                low=scale.low,
                high=scale.high,
                member="response",
            ),
        )


def clip_rating_of(experiment: "Experiment") -> ClipRating:
    """The experiment's trial as a rating of single clips; InputError where it is of another kind."""
    if not isinstance(experiment.trial, ClipRating):
        raise InputError(
            f"this needs trials of the kind clip_rating, '{experiment.name}' has {experiment.trial.kind}"
        )
    return experiment.trial
