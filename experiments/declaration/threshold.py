"""Adaptive series over a rendered grid: their [trial] and its answer."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictInt, model_validator

from experiments.declaration.base import Declaration, LevelName, Name, Translated
from experiments.declaration.trial import Answer, HasTrial, TrialDeclaration
from experiments.errors import InputError

# The keys of a [trial] whose kind is `threshold`.


class YesNo(Declaration):
    """One clip, and whether something was seen in it."""

    asks: Literal["yes_no"] = "yes_no"
    """Names this task."""
    yes: Translated
    """Label of the answer that becomes likelier along the function."""
    no: Translated
    """Label of the other answer."""
    guess: Annotated[float, Field(ge=0.001, le=0.9)] = 0.02
    """Assumed share of yes where there is nothing to be seen: the function's lower end."""


class TwoInterval(Declaration):
    """Two clips in turn, the stimulus and the standard in either order: in which of them was it?"""

    asks: Literal["two_interval"] = "two_interval"
    """Names this task."""
    standard: LevelName
    """Level of the stimulus factor that every stimulus is shown against; it is not a stimulus itself."""
    standard_second: LevelName | None = None
    """Level of the second factor that the standard has; where not given, that of the stimulus beside it."""
    first: Translated
    """Label of the answer that names the first clip."""
    second: Translated
    """Label of the answer that names the second clip."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """Plain background between the two clips, in ms."""

    @property
    def guess(self) -> float:
        """Who sees nothing names the right one of two as often as not."""
        return 0.5


Task = Annotated[YesNo | TwoInterval, Field(discriminator="asks")]


class SecondStimulus(Declaration):
    """A second factor that changes from trial to trial: series then move over the grid of both.

    The threshold along the first factor is taken to be a straight line over the numbers of the second.
    """

    factor: Name
    """The factor. Its levels with those of the first are the stimuli."""
    values: dict[LevelName, float] = Field(default_factory=dict)
    """The number of each level; may be left out where the levels are named by their numbers."""


class Stimulus(Declaration):
    """The factor along which each series looks for its threshold."""

    factor: Name
    """The factor. Its levels are the stimuli that were rendered, and a series moves between them."""
    values: dict[LevelName, float] = Field(default_factory=dict)
    """The number of each level; may be left out where the levels are named by their numbers."""
    second: SecondStimulus | None = None
    """A second factor along which series move too."""

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that a series moves along."""
        return (self.factor, self.second.factor) if self.second else (self.factor,)


class Series(Declaration):
    """One adaptive series: a level of every factor but those of the stimulus."""

    name: Name
    """Name of the series in the data."""
    levels: dict[Name, LevelName] = Field(default_factory=dict)
    """A level of every other factor of the design."""


class Range(Declaration):
    """Numbers at even distances, ends included."""

    lowest: float
    """Lowest number."""
    highest: float
    """Highest number."""
    steps: Annotated[int, Field(ge=2, le=101)] = 31
    """How many numbers, both ends included."""

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        if not self.lowest < self.highest:
            raise ValueError(f"expected lowest below highest, got {self.lowest:g} and {self.highest:g}")
        return self

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers in ascending order."""
        step = (self.highest - self.lowest) / (self.steps - 1)
        return tuple(self.lowest + index * step for index in range(self.steps))


class Stop(Declaration):
    """When a series ends: after `trials`, earlier once its estimate is as certain as `sd` and `entropy` say.

    Where both are given, both must be reached.
    """

    trials: Annotated[int, Field(ge=2, le=500)] | None = None
    """Most trials of a series. Needed: an estimate need never become as certain as is asked."""
    at_least: Annotated[int, Field(ge=1)] = 10
    """Answers that a series has before its certainty can end it."""
    sd: Annotated[float, Field(gt=0)] | None = None
    """Standard deviation of the threshold's posterior at which a series ends, in the stimulus's unit. With a
    second factor the threshold is that at the middle of its numbers, and `entropy` regards the tilt too."""
    entropy: Annotated[float, Field(gt=0)] | None = None
    """Entropy of the posterior over all parameters at which a series ends, in bits."""


class Threshold(TrialDeclaration):
    """Adaptive series by QUEST+: each answer decides which of the rendered stimuli is shown next.

    A mouse that has not moved since its last press chooses nothing until `pointer_delay_ms` have passed.
    """

    kind: Literal["threshold"] = "threshold"
    """Names this kind of trial."""
    question: Translated
    """What is asked after the clip or clips, in every language."""
    task: Task
    """One clip and yes or no, or two clips and which of them."""
    stimulus: Stimulus
    """What changes from trial to trial."""
    series: tuple[Series, ...] = ()
    """The series, run interleaved; where none is given, one a combination of the other factors' levels."""
    function: Literal["normal", "weibull"] = "normal"
    """Shape assumed for the psychometric function. The Weibull needs stimuli above 0."""
    direction: Literal["rising", "falling"] = "rising"
    """Whether yes (or right) becomes likelier with the stimulus's number, or less likely."""
    lapse: Annotated[float, Field(ge=0.001, le=0.2)] = 0.02
    """Assumed share of wrong answers to what is plain to see: 1 minus the function's upper end."""
    thresholds: Range | None = None
    """Thresholds considered; where not given, from the lowest stimulus to the highest. With a second factor
    they are those at the middle of its numbers."""
    tilts: Range | None = None
    """With a second factor, the considered changes of the threshold per unit of its numbers; where not given,
    as steep as a threshold that crosses all stimuli of the first, either way."""
    spreads: Range | None = None
    """Considered SDs of the normal function (in the stimulus's unit), or slopes of the Weibull; where not
    given, a twentieth to a half of the stimuli's range, or 1 to 10."""
    stop: Stop
    """When a series ends."""
    ahead: Annotated[int, Field(ge=0, le=20)] = 3
    """Trials of a series that a page without connection may show before the server has the answers to
    earlier ones. Such trials are marked in the data."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time, in ms, for which a mouse that has not moved since its last press chooses nothing."""
    expected_seconds: Annotated[float, Field(gt=0)] = 5.0
    """Expected length of a trial in seconds, for the length of a visit."""

    def asked(self, language: str) -> str:
        """The question and what may be answered."""
        task = self.task
        one, other = (task.yes, task.no) if isinstance(task, YesNo) else (task.first, task.second)
        names = ("yes", "no") if isinstance(task, YesNo) else ("first", "second")
        answers = ", ".join(f"{n} ({t.get(language, '')})" for n, t in zip(names, (one, other), strict=True))
        return f"Question: {self.question.get(language, '')} Answers: {answers}."

    @property
    def roles(self) -> tuple[str, ...]:
        """The roles in which a trial shows its clips, in their order."""
        return ("shown",) if isinstance(self.task, YesNo) else ("first", "second")

    @model_validator(mode="after")
    def _languages_agree(self) -> Self:
        task = self.task
        labels = {"yes": task.yes, "no": task.no} if isinstance(task, YesNo) else {}
        if isinstance(task, TwoInterval):
            labels = {"first": task.first, "second": task.second}
        for name, texts in labels.items():
            missing = sorted(set(self.question) - set(texts))
            if missing:
                raise ValueError(f"task.{name} has no text in '{missing[0]}', which the question has")
        return self

    def view_ms(self, lengths: Mapping[str, float]) -> float:
        """The one clip, or both in turn and what is between."""
        if isinstance(self.task, TwoInterval) and lengths:
            return sum(lengths.values()) + self.task.gap_ms
        return super().view_ms(lengths)


def threshold_of(experiment: HasTrial) -> Threshold:
    """The experiment's trial as a threshold; InputError where it is of another kind."""
    if not isinstance(experiment.trial, Threshold):
        raise InputError(
            f"this needs trials of the kind threshold, '{experiment.name}' has {experiment.trial.kind}"
        )
    return experiment.trial


# What a participant answers to one trial of a series.

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
