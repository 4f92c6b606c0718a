"""Questionnaires declared with the experiment: their types of field, and what may be answered."""

import random
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from experiments.columns.column import Column, plain_name
from experiments.declaration.base import Declaration, Name, Translated

# Answers to choose from.


class Option(Declaration):
    """One answer of a choice field; `value` is stored."""

    value: str
    """The value that is stored and exported, whatever the language."""
    label: Translated
    """The text that participants read."""


def among(values: list[Any], options: Sequence[Option]) -> str | None:
    """What is wrong with `values` as answers out of `options`; None where nothing is."""
    allowed = [option.value for option in options]
    wrong = [value for value in values if value not in allowed]
    return f"expected one of {', '.join(allowed)}, got {wrong[0]!r}" if wrong else None


# What every type of field has.


class Question(Declaration):
    """What every type of field has."""

    name: Name
    """Key of the answer in the `forms` column of the runs CSV. [[screening]] refers to it as `field`."""
    label: Translated
    """The question, in every language."""
    help: Translated | None = None
    """Smaller text under the question."""
    required: bool = False
    """Whether this question must be answered before the form can be sent."""

    screened_by: ClassVar[Literal["limits", "options"] | None] = None
    """How a [[screening]] rule may refuse an answer: `below` and `above`, `refused`, or not at all."""
    example: ClassVar[str] = ""
    """A field of this type as TOML, for the reference; empty if docs/reference/every-key.toml has one."""

    def problem(self, value: object) -> str | None:
        """What is wrong with an answer, expected and got; None if nothing is."""
        if is_empty(value):
            return "an answer is required" if self.required else None
        return self._problem(value)

    @property
    def values(self) -> tuple[str, ...]:
        """The answers there are, for fields of options."""
        return ()

    @abstractmethod
    def _problem(self, value: object) -> str | None:
        """As `problem`, of an answer that is not empty."""

    @abstractmethod
    def simulated(self, rng: random.Random, /) -> Any:
        """An answer that a simulated person gives."""

    @abstractmethod
    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The columns of its answers: one, for None, or one per option where several may be chosen.

        Parameters
        ----------
        name : str
            Of the column, and how those of options begin.
        asked : str
            The question in `language`.
        """


def is_empty(value: object) -> bool:
    """True where a question was left open."""
    return value is None or value in ("", [])


# The check that numbers and points of a scale share.


def whole_number(value: object, minimum: int, maximum: int) -> str | None:
    """What is wrong with `value` as a whole number within limits; None where nothing is."""
    fits = isinstance(value, int) and not isinstance(value, bool) and minimum <= value <= maximum
    return None if fits else f"expected a whole number from {minimum} to {maximum}, got {value!r}"


# Free text.


class TextField(Question):
    """Free text."""

    type: Literal["text"] = "text"
    """The type of this field."""
    max_length: Annotated[int, Field(ge=1, le=5000)] = 500
    """Longest answer, in characters."""

    def _problem(self, value: object) -> str | None:
        fits = isinstance(value, str) and len(value) <= self.max_length
        return None if fits else f"expected text of at most {self.max_length} characters"

    def simulated(self, _rng: random.Random, /) -> str:
        """A word that says where it comes from."""
        return "simulated"[: self.max_length]

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The text, by which people may be known."""
        del language
        return {None: Column(name, "text", asked, identifying=True)}


# A whole number within limits.


class NumberField(Question):
    """A whole number within limits, such as an age in years."""

    type: Literal["number"] = "number"
    """The type of this field."""
    minimum: int = 0
    """Smallest allowed answer."""
    maximum: int = 1_000_000
    """Largest allowed answer."""

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


# One of several answers.


class ChoiceField(Question):
    """One of several answers."""

    type: Literal["choice"] = "choice"
    """The type of this field."""
    options: Annotated[tuple[Option, ...], Field(min_length=2)]
    """The answers, in the order shown."""

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


# Any of several answers.


class MultipleChoiceField(Question):
    """Any of several answers."""

    type: Literal["multiple_choice"] = "multiple_choice"
    """The type of this field."""
    options: Annotated[tuple[Option, ...], Field(min_length=1)]
    """The answers, in the order shown. Participants may choose any number of them."""

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
        """For each option, whether it was chosen."""
        return {
            one.value: Column(
                f"{name}_{plain_name(one.value)}",
                "boolean",
                f"{asked} Whether chosen: {one.label.get(language, one.value)}.",
                labels=(("0", "not chosen"), ("1", "chosen")),
            )
            for one in self.options
        }


# A rating with labeled ends.


class LikertField(Question):
    """A rating from 1 to `points` with labeled ends."""

    type: Literal["likert"] = "likert"
    """The type of this field."""
    points: Annotated[int, Field(ge=2, le=11)] = 7
    """Number of points. The answer is a whole number starting at 1."""
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


# Questionnaires declared with the experiment: demographics before, comments after.
#
# A type of field is a module here, with its check of an answer, the answer that a simulated person gives, its
# columns and an example, and its place in the union; the page draws it by the module of its name in
# `frontend/src/participant/screens/fields`.

FormField = Annotated[
    TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField, Field(discriminator="type")
]


class Form(Declaration):
    """A page of questions, shown before the first block or after the last one."""

    name: Name
    """Key of the form's answers in the runs CSV. [[screening]] refers to it as `form`."""
    when: Literal["before", "after"] = "before"
    """When the form is shown. `before`: after consent, before the trials. `after`: after the last trial."""
    title: Translated
    """Heading of the page."""
    fields: Annotated[tuple[FormField, ...], Field(min_length=1)]
    """The questions, in order."""
