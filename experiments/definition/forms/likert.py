"""A rating with labelled ends."""

import random
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.base import Translated
from experiments.columns.column import Column
from experiments.definition.forms.question import Question
from experiments.definition.forms.whole_number import whole_number


class LikertField(Question):
    """A rating from 1 to `points` with labelled ends."""

    type: Literal["likert"] = "likert"
    """Names this type of field."""
    points: Annotated[int, Field(ge=2, le=11)] = 7
    """Number of points; the answer is a whole number from 1."""
    low: Translated
    """Label of the lowest point."""
    high: Translated
    """Label of the highest point."""

    screened_by: ClassVar = "limits"
    example: ClassVar = """\
type = "likert"
name = "effort"
label = { en = "How hard was it?", de = "Wie schwer war es?" }
help = { en = "On the whole", de = "Im Ganzen" }
required = true
points = 5
low = { en = "easy", de = "leicht" }
high = { en = "hard", de = "schwer" }
"""

    def _problem(self, value: object) -> str | None:
        return whole_number(value, 1, self.points)

    def simulated(self, rng: random.Random, /) -> int:
        """Any point."""
        return rng.randint(1, self.points)

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The point, the ends with their labels."""
        ends = (("1", self.low.get(language, "")), (str(self.points), self.high.get(language, "")))
        return {None: Column(name, "integer", asked, minimum=1, maximum=self.points, labels=ends)}
