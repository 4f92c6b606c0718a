"""What of a continuous rating the participant's page is told."""

from typing import TYPE_CHECKING, Literal

from experiments.base import Declaration, Translated
from experiments.trials.clip_rating.scales import Points
from experiments.trials.continuous_rating.declaration import CHECK_POINTS, continuous_rating_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


class ShownContinuousRating(Declaration):
    """The declared continuous rating as the page gets it."""

    kind: Literal["continuous_rating"]
    question: Translated
    low: Translated
    high: Translated
    minimum: float
    maximum: float
    input: Literal["slider", "keys"]
    seconds_across: float
    sample_hz: int
    pointer_delay_ms: int
    check_scale: Points
    expected_seconds: float


def shown(experiment: "Experiment") -> ShownContinuousRating:
    """Return the part of the declared trial that its page needs."""
    trial = continuous_rating_of(experiment)
    check = Points(question=trial.question, low=trial.low, high=trial.high, minimum=1, maximum=CHECK_POINTS)
    return ShownContinuousRating(
        kind=trial.kind,
        question=trial.question,
        low=trial.low,
        high=trial.high,
        minimum=trial.minimum,
        maximum=trial.maximum,
        input=trial.input,
        seconds_across=trial.seconds_across,
        sample_hz=trial.sample_hz,
        pointer_delay_ms=trial.pointer_delay_ms,
        check_scale=check,
        expected_seconds=trial.expected_seconds,
    )
