"""Questionnaires declared with the experiment: demographics before, comments after."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Name, Translated


class Option(Declaration):
    """One answer of a choice field; `value` is what is stored."""

    value: str
    label: Translated


class _Field(Declaration):
    name: Name
    label: Translated
    help: Translated | None = None
    required: bool = False


class TextField(_Field):
    """Free text."""

    type: Literal["text"] = "text"
    max_length: Annotated[int, Field(ge=1, le=5000)] = 500


class NumberField(_Field):
    """A whole number within limits, such as an age in years."""

    type: Literal["number"] = "number"
    minimum: int = 0
    maximum: int = 1_000_000


class ChoiceField(_Field):
    """One of several answers."""

    type: Literal["choice"] = "choice"
    options: Annotated[tuple[Option, ...], Field(min_length=2)]


class MultipleChoiceField(_Field):
    """Any of several answers."""

    type: Literal["multiple_choice"] = "multiple_choice"
    options: Annotated[tuple[Option, ...], Field(min_length=1)]


class LikertField(_Field):
    """A rating from 1 to `points` with labelled ends."""

    type: Literal["likert"] = "likert"
    points: Annotated[int, Field(ge=2, le=11)] = 7
    low: Translated
    high: Translated


FormField = Annotated[
    TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField, Field(discriminator="type")
]


class Form(Declaration):
    """One page of questions, shown before the first or after the last block."""

    name: Name
    when: Literal["before", "after"] = "before"
    title: Translated
    fields: Annotated[tuple[FormField, ...], Field(min_length=1)]
