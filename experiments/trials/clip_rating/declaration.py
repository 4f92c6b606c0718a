"""The keys of a [trial] whose kind is `clip_rating`."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from experiments.errors import InputError
from experiments.trials.clip_rating.reference import RatingReference
from experiments.trials.clip_rating.scales import SCALE_NAME, AnyScale, Points, Slider
from experiments.trials.declared import ClipSpec, HasFactors, HasTrial, RatedScale, TrialDeclaration

MAX_SCALES = 8
MAX_FRAMES_LOGGED = 20_000
"""Drawn frames that the log of one trial may hold, all its views together: about 320 KB as JSON."""


class ClipRating(TrialDeclaration):
    """The single-clip rating: start by key, one view (or `views`), answer after the clip's end.

    A mouse that has not moved since its last press chooses nothing until `pointer_delay_ms` have passed.
    """

    kind: Literal["clip_rating"] = "clip_rating"
    """Names this kind of trial."""
    scale: AnyScale | None = None
    """The question and its scale, where there is one: [trial.scale]."""
    scales: Annotated[tuple[AnyScale, ...], Field(max_length=MAX_SCALES)] = ()
    """One to eight scales, each with a name, instead of the one: [[trial.scales]]."""
    arrangement: Literal["one_screen", "one_after_the_other"] = "one_screen"
    """Several scales below one another on one screen, or a screen each in their order."""
    views: Annotated[int, Field(ge=1, le=10)] = 1
    """How often the clip is shown before it is rated."""
    reference: RatingReference | None = None
    """A clip shown before each rated one, in degradation category rating: [trial.reference]."""
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

    @model_validator(mode="after")
    def _scales_fit(self) -> Self:
        if (self.scale is None) == (not self.scales):
            got = "neither" if self.scale is None else "both"
            raise ValueError(f"expected [trial.scale], or [[trial.scales]] for several scales; got {got}")
        if self.scale is not None and self.scale.name != SCALE_NAME:
            raise ValueError(
                f"scale.name: a [trial.scale] has no name, got '{self.scale.name}'; use [[trial.scales]]"
            )
        names = [scale.name for scale in self.asked_scales]
        again = next((name for name in names if names.count(name) > 1), None)
        if again is not None:
            raise ValueError(f"scales: expected a name of its own for each scale, got '{again}' twice")
        missing = next(filter(None, (scale.missing_text() for scale in self.asked_scales)), None)
        if missing:
            raise ValueError(missing)
        return self

    @model_validator(mode="after")
    def _reference_fits(self) -> Self:
        if self.reference is None:
            return self
        if self.views > 1:
            raise ValueError(
                f"views: a trial with a reference shows both clips once; leave it out, got {self.views}"
            )
        missing = sorted(set(self.asked_scales[0].question) - set(self.reference.label))
        if missing:
            raise ValueError(f"reference.label has no text in '{missing[0]}', which the question has")
        return self

    def rates(self, experiment: HasFactors, clip: ClipSpec) -> bool:
        """Every clip, but references that are not rated themselves."""
        return self.reference is None or self.reference.rates(experiment, clip)

    def view_ms(self, lengths: Mapping[str, float]) -> float:
        """The clip; where there is a reference, both in turn and what is between."""
        if "reference" in lengths and self.reference is not None:
            return sum(lengths.values()) + self.reference.gap_ms
        return super().view_ms(lengths)

    def shown_ms(self, lengths: Mapping[str, float]) -> float:
        """The view as often as the clip is shown."""
        return self.views * self.view_ms(lengths)

    @property
    def asked_scales(self) -> tuple[Points | Slider, ...]:
        """The scales in order, one or several."""
        return (self.scale,) if self.scale is not None else self.scales

    @property
    def check_scale(self) -> Points:
        """The scale on which attention checks ask for a point: the first with points, else one of seven."""
        first = self.asked_scales[0]
        points = (scale for scale in self.asked_scales if isinstance(scale, Points))
        low, high = first.ends
        return next(points, Points(name=first.name, question=first.question, low=low, high=high))

    def asked(self, language: str) -> str:
        """Each scale, its ends and its question."""
        if self.asked_scales[0].name == SCALE_NAME and len(self.asked_scales) == 1:
            return self.asked_scales[0].said(language)
        said = (f"- `{scale.name}`: {scale.said(language)}" for scale in self.asked_scales)
        return "\n".join(("Scales, one row each in a trial:", "", *said))

    def rated_scales(self) -> tuple[RatedScale, ...]:
        """The scales in order; the answer to the one of a [trial.scale] is the payload's `response`."""
        if [scale.name for scale in self.asked_scales] == [SCALE_NAME]:
            return (self.asked_scales[0].rated("response"),)
        return tuple(scale.rated(f"answers.{scale.name}.response") for scale in self.asked_scales)


def clip_rating_of(experiment: HasTrial) -> ClipRating:
    """The experiment's trial as a rating of single clips; InputError where it is of another kind."""
    if not isinstance(experiment.trial, ClipRating):
        raise InputError(
            f"this needs trials of the kind clip_rating, '{experiment.name}' has {experiment.trial.kind}"
        )
    return experiment.trial
