"""Every type of field checks an answer and gives a simulated one that passes its own check."""

import random
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from experiments.declaration.forms import (
    ChoiceField,
    FormField,
    LikertField,
    MultipleChoiceField,
    NumberField,
    Option,
    Question,
    TextField,
    is_empty,
)

LABEL = {"en": "x"}
OPTIONS = tuple(Option(value=value, label=LABEL) for value in ("a", "b"))
FIELDS: tuple[Question, ...] = (
    TextField(name="t", label=LABEL, max_length=4),
    NumberField(name="n", label=LABEL, minimum=18, maximum=120),
    ChoiceField(name="c", label=LABEL, options=OPTIONS),
    MultipleChoiceField(name="m", label=LABEL, options=OPTIONS),
    LikertField(name="l", label=LABEL, points=5, low=LABEL, high=LABEL),
)
fields = pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)


def test_every_type_is_here() -> None:
    assert {type(field) for field in FIELDS} == set(get_args(get_args(FormField)[0]))


@fields
@given(seed=st.integers(0, 1000))
def test_a_simulated_answer_fits(field: Question, seed: int) -> None:
    assert field.problem(field.simulated(random.Random(seed))) is None


@fields
@pytest.mark.parametrize("empty", [None, "", []])
def test_an_open_question_is_a_problem_where_it_is_required(field: Question, empty: Any) -> None:
    assert is_empty(empty)
    assert field.problem(empty) is None
    required = field.model_copy(update={"required": True})
    assert required.problem(empty) == "an answer is required"


@fields
@pytest.mark.parametrize("wrong", [{"a": 1}, 3.5, "a long text", True, 17, ["a", "a"], ["c"]])
def test_what_does_not_fit_is_one_line(field: Question, wrong: Any) -> None:
    problem = field.problem(wrong)
    assert problem is not None
    assert problem.startswith("expected")
    assert "\n" not in problem


@fields
def test_what_the_api_sends_is_the_field_again(field: Question) -> None:
    assert TypeAdapter(FormField).validate_python(field.model_dump(mode="json")) == field
