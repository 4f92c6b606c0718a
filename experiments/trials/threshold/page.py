"""What of a threshold the participant's page is told."""

from typing import TYPE_CHECKING, Literal

from experiments.base import Declaration, Translated
from experiments.trials.threshold.declaration import YesNo, threshold_of

if TYPE_CHECKING:
    from experiments.definition import Experiment


class ShownAnswer(Declaration):
    """One of the two answers: its name in the data and its label."""

    response: Literal["yes", "no", "first", "second"]
    label: Translated


class ShownThreshold(Declaration):
    """The declared threshold as the page gets it: nothing of stimuli, series or function."""

    kind: Literal["threshold"]
    question: Translated
    answers: tuple[ShownAnswer, ShownAnswer]
    gap_ms: int
    ahead: int
    pointer_delay_ms: int
    expected_seconds: float


def shown(experiment: "Experiment") -> ShownThreshold:
    """Return the part of the declared trial that its page needs."""
    trial = threshold_of(experiment)
    task = trial.task
    if isinstance(task, YesNo):
        answers = (ShownAnswer(response="yes", label=task.yes), ShownAnswer(response="no", label=task.no))
    else:
        answers = (
            ShownAnswer(response="first", label=task.first),
            ShownAnswer(response="second", label=task.second),
        )
    return ShownThreshold(
        kind=trial.kind,
        question=trial.question,
        answers=answers,
        gap_ms=0 if isinstance(task, YesNo) else task.gap_ms,
        ahead=trial.ahead,
        pointer_delay_ms=trial.pointer_delay_ms,
        expected_seconds=trial.expected_seconds,
    )
