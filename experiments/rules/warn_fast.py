"""Warning of answers too fast to be given by looking."""

from collections.abc import Sequence
from functools import partial
from statistics import median
from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.rules.warning import GivenAnswer, Warns
from experiments.rules.warning_words import FAST_ANSWERS, in_every_language


class WarnFast(Warns):
    """Warn whose median response time in the last `answers` main trials lies below `below_ms`."""

    rule: Literal["fast_answers"] = "fast_answers"
    """Names this rule."""
    answers: Annotated[int, Field(ge=5, le=100)] = 10
    """Answers of which the median is taken."""
    below_ms: Annotated[float, Field(gt=0)] = 250.0
    """Median response time, in ms from the clip's end, under which the warning comes."""
    text: Translated = Field(default_factory=partial(in_every_language, FAST_ANSWERS))
    """Markdown of the warning, in every language."""

    def lapses(self, given: Sequence[GivenAnswer]) -> bool:
        """True where the median lies below; answers without a time, as after a reload, do not count."""
        times = [one.rt for one in given if one.rt is not None]
        return len(times) > len(given) // 2 and median(times) < self.below_ms
