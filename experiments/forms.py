"""Questionnaires declared with the experiment: demographics before, comments after.

A type of field is a class here, with its check of an answer and the answer that a simulated person gives, and
its place in the union; the page draws it in `frontend/src/participant/screens`.
"""

import random
from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from experiments.base import Declaration, Name, Translated


class Option(Declaration):
    """One answer of a choice field; `value` is what is stored."""

    value: str
    label: Translated


class Question(Declaration):
    """What every type of field has."""

    name: Name
    label: Translated
    help: Translated | None = None
    required: bool = False

    def problem(self, value: object) -> str | None:
        """What is wrong with an answer, expected and got; None where nothing is."""
        if is_empty(value):
            return "an answer is required" if self.required else None
        return self._problem(value)

    @abstractmethod
    def _problem(self, value: object) -> str | None:
        """As `problem`, of an answer that is not empty."""

    @abstractmethod
    def simulated(self, rng: random.Random, /) -> Any:
        """An answer that a simulated person gives."""


def is_empty(value: object) -> bool:
    """True where a question was left open."""
    return value is None or value in ("", [])


class TextField(Question):
    """Free text."""

    type: Literal["text"] = "text"
    max_length: Annotated[int, Field(ge=1, le=5000)] = 500

    def _problem(self, value: object) -> str | None:
        fits = isinstance(value, str) and len(value) <= self.max_length
        return None if fits else f"expected text of at most {self.max_length} characters"

    def simulated(self, _rng: random.Random, /) -> str:
        """A word that says where it comes from."""
        return "simulated"[: self.max_length]


class NumberField(Question):
    """A whole number within limits, such as an age in years."""

    type: Literal["number"] = "number"
    minimum: int = 0
    maximum: int = 1_000_000

    def _problem(self, value: object) -> str | None:
        return _whole_number(value, self.minimum, self.maximum)

    def simulated(self, rng: random.Random, /) -> int:
        """A number of the lower end of the range, where ages are likely."""
        return rng.randint(self.minimum, min(self.maximum, self.minimum + 60))


class ChoiceField(Question):
    """One of several answers."""

    type: Literal["choice"] = "choice"
    options: Annotated[tuple[Option, ...], Field(min_length=2)]

    def _problem(self, value: object) -> str | None:
        return _among([value], self.options)

    def simulated(self, rng: random.Random, /) -> str:
        """Any option."""
        return rng.choice(self.options).value


class MultipleChoiceField(Question):
    """Any of several answers."""

    type: Literal["multiple_choice"] = "multiple_choice"
    options: Annotated[tuple[Option, ...], Field(min_length=1)]

    def _problem(self, value: object) -> str | None:
        if not isinstance(value, list) or len(set(map(str, value))) != len(value):
            return "expected a list of different answers"
        return _among(value, self.options)

    def simulated(self, rng: random.Random, /) -> list[str]:
        """Any one option."""
        return [rng.choice(self.options).value]


class LikertField(Question):
    """A rating from 1 to `points` with labelled ends."""

    type: Literal["likert"] = "likert"
    points: Annotated[int, Field(ge=2, le=11)] = 7
    low: Translated
    high: Translated

    def _problem(self, value: object) -> str | None:
        return _whole_number(value, 1, self.points)

    def simulated(self, rng: random.Random, /) -> int:
        """Any point."""
        return rng.randint(1, self.points)


def _whole_number(value: object, minimum: int, maximum: int) -> str | None:
    fits = isinstance(value, int) and not isinstance(value, bool) and minimum <= value <= maximum
    return None if fits else f"expected a whole number from {minimum} to {maximum}, got {value!r}"


def _among(values: list[Any], options: Sequence[Option]) -> str | None:
    allowed = [option.value for option in options]
    wrong = [value for value in values if value not in allowed]
    return f"expected one of {', '.join(allowed)}, got {wrong[0]!r}" if wrong else None


FormField = Annotated[
    TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField, Field(discriminator="type")
]


class Form(Declaration):
    """One page of questions, shown before the first or after the last block."""

    name: Name
    when: Literal["before", "after"] = "before"
    title: Translated
    fields: Annotated[tuple[FormField, ...], Field(min_length=1)]
