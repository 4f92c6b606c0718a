"""Questionnaire answers as columns: one per question, or one per option if several may be chosen."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from experiments.columns.column import Column, unlike
from experiments.columns.old_order import in_old_order
from experiments.columns.runs import FORMS, RUN_COLUMNS
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import Form, FormField, is_empty

PREFIX = "form_"
"""No other column begins like this, and no factor name can be mistaken for one."""


@dataclass(frozen=True)
class FormColumn:
    """A column and its answer: that of a form field, or of one option if several may be chosen."""

    column: Column
    form: str
    field: str
    option: str | None = None

    def value(self, answers: Mapping[str, Mapping[str, Any]]) -> Any:
        """The cell value from a run's answers by form and field; empty if there is no answer."""
        answer = answers.get(self.form, {}).get(self.field)
        if is_empty(answer):
            return ""
        if self.option is not None:
            return int(isinstance(answer, list) and self.option in answer)
        return "; ".join(map(str, answer)) if isinstance(answer, list) else answer


def form_columns(definitions: Iterable[Experiment]) -> list[FormColumn]:
    """The columns of all versions' forms, in order; later versions of a question override earlier ones."""
    known: dict[tuple[str, str, str | None], FormColumn] = {}
    for experiment in definitions:
        language = experiment.languages[0]
        for form in experiment.forms:
            for field in form.fields:
                for column in _of_field(form, field, language):
                    key = (column.form, column.field, column.option)
                    known[key] = _united(known.get(key), column)
    return list(_named(known.values()))


def run_columns(forms: Iterable[FormColumn], old_order: bool = False) -> list[Column]:
    """The columns of the runs CSV of a study with these questions, which replace `FORMS`."""
    columns: list[Column] = []
    for column in in_old_order("runs", RUN_COLUMNS) if old_order else RUN_COLUMNS:
        columns.extend([one.column for one in forms] if column is FORMS else [column])
    return columns


def _of_field(form: Form, field: FormField, language: str) -> Iterator[FormColumn]:
    asked = field.label.get(language) or next(iter(field.label.values()))
    for option, column in field.columns(f"{PREFIX}{form.name}_{field.name}", asked, language).items():
        yield FormColumn(column, form.name, field.name, option)


def _united(before: FormColumn | None, after: FormColumn) -> FormColumn:
    """The later column, plus options that only earlier versions had."""
    if before is None or not before.column.values:
        return after
    values = tuple(dict.fromkeys((*before.column.values, *after.column.values)))
    labels = tuple({**dict(before.column.labels), **dict(after.column.labels)}.items())
    return replace(after, column=replace(after.column, values=values, labels=labels))


def _named(columns: Iterable[FormColumn]) -> Iterator[FormColumn]:
    """The columns with unique names (`a_b` with `c` is spelled like `a` with `b_c`)."""
    taken: set[str] = set()
    for one in columns:
        yield replace(one, column=replace(one.column, name=unlike(one.column.name, taken)))
