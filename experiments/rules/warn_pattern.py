"""Warning of answers that repeat in a cycle."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.rules.warning import GivenAnswer, Warns, follow_a_cycle


class WarnPattern(Warns):
    """Warn whose last `answers` main trials repeat two to `longest` answers over and over."""

    rule: Literal["repeated_pattern"] = "repeated_pattern"
    """Names this rule."""
    answers: Annotated[int, Field(ge=8, le=100)] = 20
    """Answers in a row that follow the pattern."""
    longest: Annotated[int, Field(ge=2, le=10)] = 4
    """Length of the longest pattern looked for; 1, 2, 3, 1, 2, 3 has length 3."""
    text: Translated = Field(
        default_factory=lambda: {
            "en": "# A word in between\n\nYour last answers repeat a pattern. Please answer each clip by "
            "what you see in it; there is no hurry, and a short break does no harm.",
            "de": "# Ein Wort zwischendurch\n\nIhre letzten Antworten folgen einem Muster. Bitte "
            "beantworten Sie jeden Clip nach dem, was Sie darin sehen; es eilt nicht, und eine kurze Pause "
            "schadet nicht.",
        }
    )
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where they follow a cycle of some length, and are not all equal."""
        if follow_a_cycle(given, 1):
            return False
        return any(follow_a_cycle(given, length) for length in range(2, self.longest + 1))
