"""Warning of one and the same answer."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.rules.warning import GivenAnswer, Warns, follow_a_cycle


class WarnSameAnswer(Warns):
    """Warn who gives one and the same answer in `answers` main trials in a row."""

    rule: Literal["same_answer"] = "same_answer"
    """Names this rule."""
    answers: Annotated[int, Field(ge=5, le=100)] = 20
    """Equal answers in a row. With two answers to choose from, twenty come by chance in 1 of 5,000 visits of
    100 trials."""
    text: Translated = Field(
        default_factory=lambda: {
            "en": "# A word in between\n\nYour last answers were all the same. If that is how you saw the "
            "clips, all is well. If your thoughts have wandered: take a short break, and then look at each "
            "clip anew.",
            "de": "# Ein Wort zwischendurch\n\nIhre letzten Antworten waren alle gleich. Wenn Sie die Clips "
            "so gesehen haben, ist alles gut. Wenn Sie mit den Gedanken woanders waren: Machen Sie eine "
            "kurze Pause, und sehen Sie dann jeden Clip neu an.",
        }
    )
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where all are equal."""
        return follow_a_cycle(given, 1)
