"""Warning of answers that repeat in a cycle."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.rules.warning import GivenAnswer, Warns, follow_a_cycle
from experiments.rules.warning_words import REPEATED_PATTERN, in_every_language


class WarnPattern(Warns):
    """Warn whose last `answers` main trials repeat two to `longest` answers over and over."""

    rule: Literal["repeated_pattern"] = "repeated_pattern"
    """Names this rule."""
    answers: Annotated[int, Field(ge=8, le=100)] = 20
    """Answers in a row that follow the pattern."""
    longest: Annotated[int, Field(ge=2, le=10)] = 4
    """Length of the longest pattern looked for; 1, 2, 3, 1, 2, 3 has length 3."""
    text: Translated = Field(default_factory=partial(in_every_language, REPEATED_PATTERN))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where they follow a cycle of some length, and are not all equal."""
        if follow_a_cycle(given, 1):
            return False
        return any(follow_a_cycle(given, length) for length in range(2, self.longest + 1))
