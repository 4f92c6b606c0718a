"""Questionnaires declared with the experiment: demographics before, comments after.

A type of field is a module here, with its check of an answer, the answer that a simulated person gives, its
columns and an example, and its place in the union; the page draws it by the module of its name in
`frontend/src/participant/screens/fields`.
"""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration, Name, Translated
from experiments.definition.forms.choice import ChoiceField
from experiments.definition.forms.likert import LikertField
from experiments.definition.forms.multiple_choice import MultipleChoiceField
from experiments.definition.forms.number import NumberField
from experiments.definition.forms.option import Option
from experiments.definition.forms.question import Question, is_empty
from experiments.definition.forms.text import TextField

FormField = Annotated[
    TextField | NumberField | ChoiceField | MultipleChoiceField | LikertField, Field(discriminator="type")
]


class Form(Declaration):
    """One page of questions, shown before the first or after the last block."""

    name: Name
    """Key of the form's answers in the runs CSV; [[screening]] names it as `form`."""
    when: Literal["before", "after"] = "before"
    """Shown after the consent, before the trials, or after the last trial."""
    title: Translated
    """Heading of the page."""
    fields: Annotated[tuple[FormField, ...], Field(min_length=1)]
    """The questions, in order."""


__all__ = [
    "ChoiceField",
    "Form",
    "FormField",
    "LikertField",
    "MultipleChoiceField",
    "NumberField",
    "Option",
    "Question",
    "TextField",
    "is_empty",
]
