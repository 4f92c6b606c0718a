"""Check a form's answers against its declaration."""

from collections.abc import Mapping
from typing import Any

from experiments.definition.forms import Form, is_empty
from experiments.errors import did_you_mean
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
        problem = field.problem(value)
        if problem:
            problems[field.name] = problem
        elif not is_empty(value):
            kept[field.name] = value
    if problems:
        name, problem = next(iter(problems.items()))
        raise FormInvalid(f"Form {form.name}, field {name}: {problem}.", fields=problems)
    return kept
