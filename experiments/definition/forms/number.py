"""A whole number within limits."""

import random
from collections.abc import Mapping
from typing import ClassVar, Literal

from experiments.columns.column import Column
from experiments.definition.forms.question import Question
from experiments.definition.forms.whole_number import whole_number


class NumberField(Question):
    """A whole number within limits, such as an age in years."""

    type: Literal["number"] = "number"
    """Names this type of field."""
    minimum: int = 0
    """Smallest answer taken."""
    maximum: int = 1_000_000
    """Largest answer taken."""

    screened_by: ClassVar = "limits"

    def _problem(self, value: object) -> str | None:
        return whole_number(value, self.minimum, self.maximum)

    def simulated(self, rng: random.Random, /) -> int:
        """A number of the lower end of the range, where ages are likely."""
        return rng.randint(self.minimum, min(self.maximum, self.minimum + 60))

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The number."""
        del language
        return {None: Column(name, "integer", asked, minimum=self.minimum, maximum=self.maximum)}
