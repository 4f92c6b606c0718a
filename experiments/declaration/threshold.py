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
    """The name of this task."""
    yes: Translated
    """Label of the answer that becomes more likely along the function."""
    no: Translated
    """Label of the other answer."""
    guess: Annotated[float, Field(ge=0.001, le=0.9)] = 0.02
    """Assumed share of "yes" answers if there is nothing to see: the lower end of the function."""


class TwoInterval(Declaration):
    """Two clips in turn, the stimulus and the standard in random order. The participant chooses one."""

    asks: Literal["two_interval"] = "two_interval"
    """The name of this task."""
    standard: LevelName
    """Level of the stimulus factor that every stimulus is compared with. It is not a stimulus itself."""
    standard_second: LevelName | None = None
    """Level of the second factor in the standard. If empty, it is that of the stimulus."""
    first: Translated
    """Label of the answer for the first clip."""
    second: Translated
    """Label of the answer for the second clip."""
    gap_ms: Annotated[int, Field(ge=0, le=10_000)] = 500
    """Blank background between the two clips, in ms."""

    @property
    def guess(self) -> float:
        """Chance level of two-interval forced choice."""
        return 0.5


Task = Annotated[YesNo | TwoInterval, Field(discriminator="asks")]


class SecondStimulus(Declaration):
    """A second factor that changes from trial to trial: series then move on the grid of both factors.

    The threshold of the first factor is assumed to be a straight line over the numbers of the second.
    """

    factor: Name
    """The second factor. The stimuli are the combinations of its levels with those of the first."""
    values: dict[LevelName, float] = Field(default_factory=dict)
    """The number of each level. Leave empty if the level names are numbers."""


class Stimulus(Declaration):
    """The factor along which each series searches for its threshold."""

    factor: Name
    """The factor. Its levels are the rendered stimuli, and a series moves between them."""
    values: dict[LevelName, float] = Field(default_factory=dict)
    """The number of each level. Leave empty if the level names are numbers."""
    second: SecondStimulus | None = None
    """A second factor along which series also move."""

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that a series moves along."""
        return (self.factor, self.second.factor) if self.second else (self.factor,)


class Series(Declaration):
    """One adaptive series: a level of every factor except the stimulus factors."""

    name: Name
    """Name of the series in the data."""
    levels: dict[Name, LevelName] = Field(default_factory=dict)
    """A level of every other factor of the design."""


class Range(Declaration):
    """Evenly spaced numbers, including both ends."""

    lowest: float
    """Lowest number."""
    highest: float
    """Highest number."""
    steps: Annotated[int, Field(ge=2, le=101)] = 31
    """How many numbers, including both ends."""

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
    """When a series ends: after `trials`, or earlier once its estimate is precise enough (`sd`, `entropy`).

    If both `sd` and `entropy` are set, both must be reached.
    """

    trials: Annotated[int, Field(ge=2, le=500)] | None = None
    """Maximum number of trials in a series. It is required because an estimate might never become precise
    enough."""
    at_least: Annotated[int, Field(ge=1)] = 10
    """Minimum number of answers before precision can end a series."""
    sd: Annotated[float, Field(gt=0)] | None = None
    """Standard deviation of the threshold's posterior at which a series ends, in the unit of the stimulus.
    With a second factor, it is evaluated at the middle of its numbers; `entropy` also covers the tilt."""
    entropy: Annotated[float, Field(gt=0)] | None = None
    """Entropy of the posterior over all parameters at which a series ends, in bits."""


class Threshold(TrialDeclaration):
    """Adaptive series by QUEST+: each answer determines which rendered stimulus is shown next.

    If the mouse has not moved since its last click, clicks are ignored until `pointer_delay_ms` have passed.
    """

    kind: Literal["threshold"] = "threshold"
    """The kind of this trial."""
    question: Translated
    """The question after the clip or clips, in every language."""
    task: Task
    """One clip with yes or no, or a choice between two clips."""
    stimulus: Stimulus
    """What changes from trial to trial."""
    series: tuple[Series, ...] = ()
    """The series, which run interleaved. If empty, there is one per combination of the other factors'
    levels."""
    function: Literal["normal", "weibull"] = "normal"
    """Assumed shape of the psychometric function. The Weibull function needs stimuli above 0."""
    direction: Literal["rising", "falling"] = "rising"
    """Whether "yes" (or a correct answer) becomes more or less likely as the stimulus number increases."""
    lapse: Annotated[float, Field(ge=0.001, le=0.2)] = 0.02
    """Assumed share of wrong answers to obvious stimuli: 1 minus the upper end of the function."""
    thresholds: Range | None = None
    """Thresholds considered. If empty, they range from the lowest to the highest stimulus. With a second
    factor, they apply to the middle of its numbers."""
    tilts: Range | None = None
    """With a second factor: the changes of the threshold considered, per unit of its numbers. If empty, they
    range up to the slope at which the threshold crosses all stimuli of the first factor, in both
    directions."""
    spreads: Range | None = None
    """SDs of the normal function (in the unit of the stimulus) or slopes of the Weibull function to consider.
    If empty, 1/20 to 1/2 of the range of the stimuli, or slopes from 1 to 10."""
    stop: Stop
    """When a series ends."""
    ahead: Annotated[int, Field(ge=0, le=20)] = 3
    """Trials of a series that an offline page may show before the server has received earlier answers. These
    trials are marked in the data."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time in ms for which clicks are ignored if the mouse has not moved since its last click."""
    expected_seconds: Annotated[float, Field(gt=0)] = 5.0
    """Average duration of a trial, in seconds. The length of a visit is computed from it."""

    def asked(self, language: str) -> str:
        """The question and the possible answers."""
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
            f"expected trials of the kind threshold, got {experiment.trial.kind} in '{experiment.name}'"
        )
    return experiment.trial


# The answer to one trial of a series.

CODES = {"yes": 1, "no": 2, "first": 1, "second": 2}
"""The number of each answer, as used by its key and by attention checks."""


class ThresholdAnswer(Answer):
    """The answer; None where the clips could not be shown."""

    kind: Literal["threshold"]
    chosen: Literal["yes", "no", "first", "second"] | None
    known: Annotated[StrictInt, Field(ge=0, le=100_000)] = 0
    """How many answers of the series the server had used when it chose this stimulus, as it reported."""

    @property
    def given(self) -> bool:
        """True where there is an answer."""
        return self.chosen is not None


def check_response(payload: Mapping[str, Any]) -> int | None:
    """The number of a stored answer."""
    return CODES.get(payload["chosen"])
