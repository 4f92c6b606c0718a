"""A forced choice of two words after a clip: its [trial] and its answer."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.declaration.base import Translated
from experiments.declaration.trial import Answer, HasTrial, TrialDeclaration
from experiments.errors import InputError

Word = Literal["first", "second"]


class WordChoice(TrialDeclaration):
    """A clip, then which of two words describes it."""

    kind: Literal["word_choice"] = "word_choice"
    """Names this kind of trial."""
    question: Translated
    """The question, in every language."""
    first: Translated
    """The first word."""
    second: Translated
    """The second word."""
    pointer_delay_ms: Annotated[int, Field(ge=0, le=10_000)] = 1500
    """Time, in ms, for which a mouse that has not moved since its last press starts nothing."""

    def asked(self, language: str) -> str:
        """The question and the words."""
        return f"{self.question[language]} ({self.first[language]} / {self.second[language]})"


class WordAnswer(Answer):
    """The word chosen; none where the clip could not be shown."""

    kind: Literal["word_choice"]
    chosen: Word | None


def word_choice_of(experiment: HasTrial) -> WordChoice:
    """The experiment's trial as a choice of words; InputError where it is of another kind."""
    if not isinstance(experiment.trial, WordChoice):
        raise InputError(
            f"this needs trials of the kind word_choice, '{experiment.name}' has {experiment.trial.kind}"
        )
    return experiment.trial
