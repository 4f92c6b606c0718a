"""Any of several answers."""

import random
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.definition.forms.option import Option, among
from experiments.definition.forms.question import Question


class MultipleChoiceField(Question):
    """Any of several answers."""

    type: Literal["multiple_choice"] = "multiple_choice"
    """Names this type of field."""
    options: Annotated[tuple[Option, ...], Field(min_length=1)]
    """The answers, in the order in which they are listed; any number of them may be chosen."""

    screened_by: ClassVar = "options"

    @property
    def values(self) -> tuple[str, ...]:
        """The stored values of the options."""
        return tuple(option.value for option in self.options)

    def _problem(self, value: object) -> str | None:
        if not isinstance(value, list) or len(set(map(str, value))) != len(value):
            return "expected a list of different answers"
        return among(value, self.options)

    def simulated(self, rng: random.Random, /) -> list[str]:
        """Any one option."""
        return [rng.choice(self.options).value]
