"""Which group a participant comes into: by turn, by the link they came by, or by what they answer."""

from typing import TYPE_CHECKING, NamedTuple

from experiments.assignment.groups import names
from experiments.errors import did_you_mean
from experiments.rules import ScreenFormAnswer

if TYPE_CHECKING:
    from experiments.definition import Experiment
    from experiments.definition.forms import Question


class Deciding(NamedTuple):
    """The question whose answer decides the group."""

    form: str
    field: str


def deciding(experiment: "Experiment") -> Deciding | None:
    """The question whose answer decides the group; None where no answer does."""
    name = experiment.groups.question
    return next((where for where, field in _questions(experiment) if field.name == name), None)


def group_of_answer(experiment: "Experiment", answer: str) -> str:
    """Name of the group of who gives this (checked) answer to the deciding question."""
    return experiment.groups.answers.get(answer, answer)


def fault(experiment: "Experiment") -> str | None:
    """What in [groups] does not fit the experiment, as `path: what to do`; None where all is well."""
    declared, known = experiment.groups, names(experiment)
    if declared == type(declared)():
        return None
    if len(known) < 2:
        return "groups: no factor is between participants; set `between = true` on one, or leave it out"
    for path, named in (("quotas", declared.quotas), ("answers", declared.answers.values())):
        unknown = next((name for name in named if name not in known), None)
        if unknown is not None:
            return f"groups.{path}: no group is called '{unknown}'{did_you_mean(unknown, known)}"
    if declared.question is None:
        return "groups.answers: give it with by = 'form:question' only" if declared.answers else None
    return _fault_of_question(experiment, declared.question)


def _questions(experiment: "Experiment") -> "list[tuple[Deciding, Question]]":
    """The questions before the trials, with their places."""
    before = (form for form in experiment.forms if form.when == "before")
    return [(Deciding(form.name, field.name), field) for form in before for field in form.fields]


def _fault_of_question(experiment: "Experiment", name: str) -> str | None:
    from experiments.definition.forms import ChoiceField

    every = _questions(experiment)
    asked = [(where, field) for where, field in every if field.name == name]
    if not asked:
        near = did_you_mean(name, [where.field for where, _ in every])
        return f"groups.by: no form before the trials asks '{name}'{near}"
    if len(asked) > 1:
        return f"groups.by: '{name}' is asked in two forms; give the one that decides another name"
    [(where, field)] = asked
    if not isinstance(field, ChoiceField):
        return f"groups.by: '{name}' is no choice of one answer; only such a question decides a group"
    if not field.required:
        return f"groups.by: '{name}' may be left open; set `required = true`"
    return _fault_of_answers(experiment, where, field.values)


def _fault_of_answers(experiment: "Experiment", where: Deciding, values: tuple[str, ...]) -> str | None:
    unknown = next((answer for answer in experiment.groups.answers if answer not in values), None)
    if unknown is not None:
        return f"groups.answers: '{where.field}' has no option '{unknown}'{did_you_mean(unknown, values)}"
    refused = {
        value
        for rule in experiment.screening
        if isinstance(rule, ScreenFormAnswer) and (rule.form, rule.field) == where
        for value in rule.refused
    }
    known = names(experiment)
    for value in values:
        if value not in refused and group_of_answer(experiment, value) not in known:
            return (
                f"groups.answers: '{value}' leads to none of the groups {', '.join(known)}; give its group, "
                "or refuse the answer by a [[screening]] rule"
            )
    return None
