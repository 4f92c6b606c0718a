"""One of several answers."""

import random
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from experiments.columns.column import Column
from experiments.definition.forms.option import Option, among
from experiments.definition.forms.question import Question


class ChoiceField(Question):
    """One of several answers."""

    type: Literal["choice"] = "choice"
    """Names this type of field."""
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    """The answers, in the order in which they are listed."""

    screened_by: ClassVar = "options"

    @property
    def values(self) -> tuple[str, ...]:
        """The stored values of the options."""
        return tuple(option.value for option in self.options)

    def _problem(self, value: object) -> str | None:
        return among([value], self.options)

    def simulated(self, rng: random.Random, /) -> str:
        """Any option."""
        return rng.choice(self.options).value

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The option's value."""
        labels = tuple((one.value, one.label.get(language, one.value)) for one in self.options)
        return {None: Column(name, "text", asked, values=self.values, labels=labels)}
