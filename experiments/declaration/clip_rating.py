"""One clip after another, each rated on scales: its [trial], its scales, its reference, its answer."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, StrictFloat, StrictInt, field_validator, model_validator

from experiments.declaration.base import IMPLIED, Declaration, LevelName, Name, Translated
from experiments.declaration.trial import Answer, ClipSpec, HasFactors, HasTrial, RatedScale, TrialDeclaration
from experiments.errors import InputError

# What every type of scale declares and offers to the rest of the program.

SCALE_NAME = "rating"
"""Name of the scale of a [trial.scale], which has no `name` key."""


class Scale(Declaration):
    """A question and the answers to it; a type of scale adds its keys, its range and a constant as `type`."""

    type: str
    """Type of scale."""
    name: Name = SCALE_NAME
    """Name of the scale in the data (column `scale`). With several scales, each needs a unique name."""
    question: Translated
    """The question, in every language."""
    reverse: bool = False
    """Whether a high answer means a low value of what is measured. The data keep the answer as given."""
    not_applicable: Translated | None = None
    """Label of an additional answer such as `cannot say`. It is stored without a number."""

    @property
    @abstractmethod
    def lowest(self) -> float:
        """The lowest answer."""

    @property
    @abstractmethod
    def highest(self) -> float:
        """The highest answer."""

    @property
    def interval(self) -> float:
        """The smallest difference between two answers."""
        return 1

    @property
    @abstractmethod
    def ends(self) -> tuple[Translated, Translated]:
        """Labels of the lowest and of the highest answer."""

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """Key and text of everything that participants read, except the question."""
        if self.not_applicable:
            yield "not_applicable", self.not_applicable

    def missing_text(self) -> str | None:
        """The first text that lacks a language of the question; None if all have it."""
        for key, text in self.texts():
            missing = sorted(set(self.question) - set(text))
            if missing:
                return f"{key} of the scale {self.name} has no text in '{missing[0]}', which the question has"
        return None

    def rated(self, member: str) -> RatedScale:
        """The scale as results and analysis read it, its number at the path `member` of the stored answer."""
        low, high = self.ends
        return RatedScale(
            name=self.name,
            type=self.type,
            minimum=self.lowest,
            maximum=self.highest,
            step=self.interval,
            reverse=self.reverse,
            not_applicable=self.not_applicable is not None,
            question=self.question,
            low=low,
            high=high,
            member=member,
        )

    def said(self, language: str) -> str:
        """The scale in one line of the codebook."""
        low, high = (label.get(language, "") for label in self.ends)
        beside = self.not_applicable and f" Or: {self.not_applicable.get(language, '')} (not_applicable)."
        turned = " Reverse-keyed: a high answer means a low value; answers are stored as chosen."
        return (
            f"Scale: {self.lowest:g} ({low}) to {self.highest:g} ({high}). "
            f"Question: {self.question.get(language, '')}{beside or ''}{turned if self.reverse else ''}"
        )


# Whole numbers next to one another, with labels at the ends or at each number.


class Points(Scale):
    """The points of a rating scale: whole numbers from `minimum` to `maximum`, 2 to 11 of them.

    Label either the two ends (`low`, `high`) or every point (`labels`).
    """

    type: Annotated[Literal["points"], IMPLIED] = "points"
    """The type of this scale. It is the default type."""
    minimum: int = 1
    """Lowest point of the scale, a whole number."""
    maximum: int = 7
    """Highest point. The scale must have 2 to 11 points."""
    low: Translated | None = None
    """Label of the lowest point."""
    high: Translated | None = None
    """Label of the highest point."""
    labels: tuple[Translated, ...] = ()
    """Labels of all points, starting with the lowest. Use this instead of `low` and `high`."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        count = self.maximum - self.minimum + 1
        if not 2 <= count <= 11:
            raise ValueError(f"expected 2 to 11 scale points, got {self.minimum} to {self.maximum}")
        if self.labels and (self.low or self.high):
            raise ValueError("expected low and high, or labels of all points; got both")
        if self.labels and len(self.labels) != count:
            raise ValueError(f"expected {count} labels, one per point, got {len(self.labels)}")
        if not self.labels and not (self.low and self.high):
            raise ValueError("expected low and high, or labels of all points; got neither")
        return self

    @property
    def lowest(self) -> float:
        """The lowest point."""
        return self.minimum

    @property
    def highest(self) -> float:
        """The highest point."""
        return self.maximum

    @property
    def ends(self) -> tuple[Translated, Translated]:
        """The labels of the first and of the last point."""
        return (self.low or self.labels[0], self.high or self.labels[-1])

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """Include the labels."""
        yield from super().texts()
        yield from (("labels", label) for label in self.labels)

    def said(self, language: str) -> str:
        """Include every label if there are more than two."""
        points = (
            f"{self.minimum + step} {label.get(language, '')}" for step, label in enumerate(self.labels)
        )
        return super().said(language) + (f" Labels: {', '.join(points)}." if self.labels else "")


# A line between two labels, without a handle before it is first touched.

MAX_STEPS = 10_000

Finite = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class Slider(Scale):
    """A slider from `minimum` to `maximum`. The handle appears on the first touch, so untouched sliders have
    no answer."""

    type: Literal["slider"] = "slider"
    """The type of this scale."""
    minimum: Finite = 0.0
    """The number at the left end (at the right end in right-to-left languages)."""
    maximum: Finite = 100.0
    """The number at the other end."""
    step: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Difference between neighboring answers. The range must be a whole number of steps."""
    low: Translated
    """Label of the low end."""
    high: Translated
    """Label of the high end."""
    show_value: bool = False
    """Whether the number is shown while the slider moves."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        steps = (self.maximum - self.minimum) / self.step
        if not 1 <= round(steps) <= MAX_STEPS or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"expected a range of 1 to {MAX_STEPS} whole steps, got {self.minimum:g} to {self.maximum:g} "
                f"in steps of {self.step:g}"
            )
        return self

    @property
    def lowest(self) -> float:
        """The number at the low end."""
        return self.minimum

    @property
    def highest(self) -> float:
        """The number at the high end."""
        return self.maximum

    @property
    def interval(self) -> float:
        """The declared step."""
        return self.step

    @property
    def ends(self) -> tuple[Translated, Translated]:
        """The two labels."""
        return (self.low, self.high)

    def texts(self) -> Iterator[tuple[str, Translated]]:
        """Include the labels."""
        yield from super().texts()
        yield from (("low", self.low), ("high", self.high))


# The types of scale on which a clip is rated.
#
# A type is a module here and its place in the union, and the widget of its name in
# `frontend/src/participant/trials/scales`.


def _with_type(value: Any) -> Any:
    return {"type": "points", **value} if isinstance(value, dict) and "type" not in value else value


AnyScale = Annotated[Points | Slider, Field(discriminator="type"), BeforeValidator(_with_type)]


# The reference of degradation category rating (ITU-T P.910): which clip comes before the rated one.


class RatingReference(Declaration):
    """The clip shown before each rated clip, as in degradation category rating (ITU-T P.910).

    It is either the rated clip with another `level` of one `factor`, or the clip of one `cell` with the same
    exemplar number as the rated clip.
    """

    factor: Name | None = None
    """The factor in which the reference differs from the rated clip. All other levels and the exemplar are
    those of the rated clip."""
    level: LevelName | None = None
    """The level of that factor in the reference."""
    cell: str | None = None
    """Label of the reference cell, instead of `factor` and `level`: its level names in factor order,
    separated by slashes. Between-participant levels are the participant's own."""
    label: Translated
    """Text below the reference while it plays, in every language."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 2000
    """Blank background between the reference and the rated clip, in ms."""
    rate_itself: bool = False
    """Whether the reference is also rated against itself (the hidden reference of P.910). If off, its cells
    are not rated."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.factor is None) != (self.level is None):
            given, missing = ("level", "factor") if self.factor is None else ("factor", "level")
            raise ValueError(f"expected factor and level together, got {given} without {missing}")
        if (self.factor is None) == (self.cell is None):
            got = "neither" if self.cell is None else "both"
            raise ValueError(f"expected factor and level, or cell; got {got}")
        return self

    def of(self, experiment: HasFactors, clip: ClipSpec) -> ClipSpec:
        """The reference of this clip; a clip in the reference's cell is its own reference."""
        if self.factor is not None and self.level is not None:
            levels = tuple(
                (name, self.level if name == self.factor else level) for name, level in clip.levels
            )
            return ClipSpec(levels, clip.exemplar)
        named = dict(zip(experiment.factor_names, str(self.cell).split("/"), strict=True))
        named |= {factor.name: clip.level(factor.name) for factor in experiment.factors if factor.between}
        return ClipSpec(tuple(named.items()), clip.exemplar)

    def said(self) -> str:
        """The reference in one line of a plan."""
        named = (
            f"its own with {self.factor} {self.level}"
            if self.cell is None
            else f"that of the cell {self.cell}"
        )
        itself = "rated too, against itself" if self.rate_itself else "not rated itself"
        return f"before each clip its reference: {named}, {itself}; {self.gap_ms} ms between the two"

    def rates(self, experiment: HasFactors, clip: ClipSpec) -> bool:
        """Whether this clip is rated: all but the references, unless they are hidden among the others."""
        return self.rate_itself or self.of(experiment, clip) != clip


# The keys of a [trial] whose kind is `clip_rating`.

MAX_SCALES = 8
MAX_FRAMES_LOGGED = 20_000
"""Drawn frames that the log of one trial may hold, all its views together: about 320 KB as JSON."""


class ClipRating(TrialDeclaration):
    """Rating of single clips: start by key, one view (or `views`), answer after the end of the clip.

    If the mouse has not moved since its last click, clicks are ignored until `pointer_delay_ms` have passed.
    """

    kind: Literal["clip_rating"] = "clip_rating"
    """The kind of this trial."""
    scale: AnyScale | None = None
    """The question and its scale, if there is only one: [trial.scale]."""
    scales: Annotated[tuple[AnyScale, ...], Field(max_length=MAX_SCALES)] = ()
    """One to eight named scales, instead of a single scale: [[trial.scales]]."""
    arrangement: Literal["one_screen", "one_after_the_other"] = "one_screen"
    """With several scales: all on one screen, or one screen per scale in their order."""
    views: Annotated[int, Field(ge=1, le=10)] = 1
    """How often the clip is shown before it is rated."""
    reference: RatingReference | None = None
    """A clip shown before each rated clip, for degradation category rating: [trial.reference]."""
    start: Literal["key", "fixation"] = "key"
    """A clip starts on a key press, or automatically after a fixation cross."""
    fixation_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """How long the fixation cross is shown before the clip, in ms; with `start = "fixation"`."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time in ms for which clicks are ignored if the mouse has not moved since its last click."""
    confirm: bool = False
    """Whether participants confirm each rating. They can change it until then."""
    comment: bool = False
    """Adds a text field to the rating screen. Its text is stored in the column `comment`."""

    @model_validator(mode="after")
    def _scales_fit(self) -> Self:
        if (self.scale is None) == (not self.scales):
            got = "neither" if self.scale is None else "both"
            raise ValueError(f"expected [trial.scale], or [[trial.scales]] for several scales; got {got}")
        if self.scale is not None and self.scale.name != SCALE_NAME:
            raise ValueError(
                f"scale.name: expected no name in [trial.scale], got '{self.scale.name}'; use "
                f"[[trial.scales]] for named scales"
            )
        names = [scale.name for scale in self.asked_scales]
        again = next((name for name in names if names.count(name) > 1), None)
        if again is not None:
            raise ValueError(f"scales: expected a unique name for each scale, got '{again}' twice")
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
                f"views: expected 1, because a trial with a reference shows both clips once; got {self.views}"
            )
        missing = sorted(set(self.asked_scales[0].question) - set(self.reference.label))
        if missing:
            raise ValueError(f"reference.label has no text in '{missing[0]}', which the question has")
        return self

    def rates(self, experiment: HasFactors, clip: ClipSpec) -> bool:
        """Every clip, except references that are not rated themselves."""
        return self.reference is None or self.reference.rates(experiment, clip)

    def view_ms(self, lengths: Mapping[str, float]) -> float:
        """The clip; with a reference, both clips and the gap between them."""
        if "reference" in lengths and self.reference is not None:
            return sum(lengths.values()) + self.reference.gap_ms
        return super().view_ms(lengths)

    def shown_ms(self, lengths: Mapping[str, float]) -> float:
        """One view times the number of views."""
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


# The answer to one clip: a number on each scale, or that the scale does not apply.


class ScaleAnswer(Declaration):
    """The answer on one scale; neither a number nor `not_applicable` where the clip could not be shown."""

    response: StrictInt | Annotated[StrictFloat, Field(allow_inf_nan=False)] | None
    not_applicable: bool = False
    rt: Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)] | None = None
    """From the last frame of the clip to this answer, in ms; with a single scale it equals that of the
    trial."""

    @field_validator("response")
    @classmethod
    def _plain(cls, value: float | None) -> float | None:
        """Store a whole number as an integer, however it was sent."""
        return int(value) if isinstance(value, float) and value.is_integer() else value

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if self.not_applicable and self.response is not None:
            raise ValueError(f"expected a number or not_applicable, got both: {self.response}")
        return self

    @property
    def given(self) -> bool:
        """True where something was answered."""
        return self.not_applicable or self.response is not None


class RatingAnswer(Answer):
    """The answers to one clip by the name of their scale; a [trial.scale] is called `rating`."""

    kind: Literal["clip_rating"]
    answers: Annotated[dict[Name, ScaleAnswer], Field(min_length=1, max_length=MAX_SCALES)]
    reference_gap_ms: Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)] | None = None
    """From the reference's last frame to the rated clip's first as they were drawn, where there is one."""

    @property
    def given(self) -> bool:
        """True where every scale was answered."""
        return all(answer.given for answer in self.answers.values())

    def stored(self) -> dict[str, Any]:
        """One number for the single scale of a [trial.scale]; otherwise one object per scale."""
        gap = {} if self.reference_gap_ms is None else {"reference_gap_ms": self.reference_gap_ms}
        if self.answers.keys() == {SCALE_NAME}:
            return self.answers[SCALE_NAME].model_dump(exclude_defaults=True, exclude={"rt"}) | gap
        answers = {name: one.model_dump(exclude_defaults=True) for name, one in self.answers.items()}
        return {"answers": answers, **gap}


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer to an attention check, which is asked on one scale."""
    answers = list(payload.get("answers", {"": payload}).values())
    return answers[0]["response"] if len(answers) == 1 else None
