"""Any of several answers."""

import random
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.columns.column import Column
from experiments.columns.names import plain_name
from experiments.definition.forms.option import Option, among
from experiments.definition.forms.question import Question


class MultipleChoiceField(Question):
    """Any of several answers."""

    type: Literal["multiple_choice"] = "multiple_choice"
    """Names this type of field."""
    options: Annotated[tuple[Option, ...], Field(min_length=1)]
    """The answers, in the order in which they are listed; any number of them may be chosen."""

    screened_by: ClassVar = "options"
    example: ClassVar = """\
type = "multiple_choice"
name = "noticed"
label = { en = "What did you look at?", de = "Worauf haben Sie geachtet?" }
help = { en = "Any number of answers", de = "Beliebig viele Antworten" }
required = false
options = [
    { value = "speed", label = { en = "Speed", de = "Geschwindigkeit" } },
    { value = "closure", label = { en = "How far the eye closed", de = "Wie weit sich das Auge schloss" } },
]
"""

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

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """Of each option, whether it was chosen."""
        return {
            one.value: Column(
                f"{name}_{plain_name(one.value)}",
                "boolean",
                f"{asked} Whether chosen: {one.label.get(language, one.value)}.",
                labels=(("0", "not chosen"), ("1", "chosen")),
            )
            for one in self.options
        }
