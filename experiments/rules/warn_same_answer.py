"""Warning of one and the same answer."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.rules.warning import GivenAnswer, Warns, follow_a_cycle
from experiments.rules.warning_words import SAME_ANSWER, in_every_language


class WarnSameAnswer(Warns):
    """Warn who gives one and the same answer in `answers` main trials in a row."""

    rule: Literal["same_answer"] = "same_answer"
    """Names this rule."""
    answers: Annotated[int, Field(ge=5, le=100)] = 20
    """Equal answers in a row. With two answers to choose from, twenty come by chance in 1 of 5,000 visits of
    100 trials."""
    text: Translated = Field(default_factory=partial(in_every_language, SAME_ANSWER))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where all are equal."""
        return follow_a_cycle(given, 1)
