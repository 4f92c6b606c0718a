"""Check a form's answers against its declaration."""

from collections.abc import Mapping
from typing import Any

from experiments.errors import did_you_mean
from experiments.forms import (
    ChoiceField,
    Form,
    FormField,
    LikertField,
    MultipleChoiceField,
    NumberField,
    TextField,
)
from server.participants.refusals import FormInvalid


def checked_answers(form: Form, answers: Mapping[str, Any]) -> dict[str, Any]:
    """The answers in declared order; FormInvalid names every field that does not fit."""
    names = [field.name for field in form.fields]
    problems = {
        name: f"the form has no field '{name}'{did_you_mean(name, names)}"
        for name in answers
        if name not in names
    }
    kept: dict[str, Any] = {}
    for field in form.fields:
        value = answers.get(field.name)
        problem = _problem(field, value)
        if problem:
            problems[field.name] = problem
        elif not _empty(value):
            kept[field.name] = value
    if problems:
        name, problem = next(iter(problems.items()))
        raise FormInvalid(f"Form {form.name}, field {name}: {problem}.", fields=problems)
    return kept


def _empty(value: object) -> bool:
    return value is None or value in ("", [])


def _problem(field: FormField, value: object) -> str | None:
    if _empty(value):
        return "an answer is required" if field.required else None
    match field:
        case TextField():
            fits = isinstance(value, str) and len(value) <= field.max_length
            return None if fits else f"expected text of at most {field.max_length} characters"
        case NumberField():
            return _whole_number(value, field.minimum, field.maximum)
        case LikertField():
            return _whole_number(value, 1, field.points)
        case ChoiceField():
            return _among([value], [option.value for option in field.options])
        case MultipleChoiceField():
            if not isinstance(value, list) or len(set(map(str, value))) != len(value):
                return "expected a list of different answers"
            return _among(value, [option.value for option in field.options])


def _whole_number(value: object, minimum: int, maximum: int) -> str | None:
    fits = isinstance(value, int) and not isinstance(value, bool) and minimum <= value <= maximum
    return None if fits else f"expected a whole number from {minimum} to {maximum}, got {value!r}"


def _among(values: list[Any], allowed: list[str]) -> str | None:
    wrong = [value for value in values if value not in allowed]
    return f"expected one of {', '.join(allowed)}, got {wrong[0]!r}" if wrong else None
