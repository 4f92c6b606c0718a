"""Groups of participants, and how participants are assigned to them."""

from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

from experiments import design
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import ChoiceField, Question
from experiments.declaration.trial import ClipSpec
from experiments.errors import did_you_mean
from experiments.rules import ScreenFormAnswer

# Groups of participants: one for each combination of levels of the between-participant factors.


class Seat(NamedTuple):
    """Position of a participant: the levels of their group, and their place in it, from 0."""

    levels: tuple[tuple[str, str], ...]
    number: int


def groups(experiment: Experiment) -> list[tuple[tuple[str, str], ...]]:
    """The levels of each group, last factor fastest; one group without levels if no factor is between."""
    between = [factor for factor in experiment.factors if factor.between]
    return list(product(*([(factor.name, level.name) for level in factor.levels] for factor in between)))


def name_of(levels: Iterable[tuple[str, str]]) -> str:
    """Name of a group in quotas, links and exports; empty if there is only one group."""
    return "/".join(level for _, level in levels)


def names(experiment: Experiment) -> list[str]:
    """The groups by name, in the order of their turns."""
    return [name_of(levels) for levels in groups(experiment)]


def seat_of(experiment: Experiment, slot: int) -> Seat:
    """The seat of a slot of the study: groups take turns, so that their sizes differ by at most one."""
    every = groups(experiment)
    return Seat(every[slot % len(every)], slot // len(every))


# Decision 0515: Groups have quotas and are chosen before the slot.
def of_group(experiment: Experiment, levels: Iterable[tuple[str, str]]) -> Experiment:
    """The experiment as one group sees it: between-participant factors have only the group's level."""
    mine = dict(levels)
    if not mine:
        return experiment
    factors = []
    for factor in experiment.factors:
        kept = tuple(level for level in factor.levels if mine.get(factor.name, level.name) == level.name)
        factors.append(factor.model_copy(update={"levels": kept}))
    return experiment.model_copy(update={"factors": tuple(factors)})


def cells_of(experiment: Experiment, seat: Seat) -> list[tuple[tuple[str, str], ...]]:
    """The cells that the group sees, in the order of the design."""
    return [cell for cell in design.cells(experiment) if set(seat.levels) <= set(cell)]


def clips_of(experiment: Experiment, seat: Seat) -> list[ClipSpec]:
    """The clips of those cells, in the order of the design."""
    return [clip for clip in design.clips(experiment) if set(seat.levels) <= set(clip.levels)]


# Which group a participant is assigned to: by turn, by their link, or by their answer.


class DecidingQuestion(NamedTuple):
    """The question whose answer decides the group."""

    form: str
    field: str


def deciding_question(experiment: Experiment) -> DecidingQuestion | None:
    """The question whose answer decides the group; None if no answer does."""
    name = experiment.groups.question
    return next((where for where, field in _questions(experiment) if field.name == name), None)


def group_of_answer(experiment: Experiment, answer: str) -> str:
    """Name of the group of a participant with this (checked) answer to the deciding question."""
    return experiment.groups.answers.get(answer, answer)


def fault_of_grouping(experiment: Experiment) -> str | None:
    """What in [groups] does not fit the experiment, as `path: what to do`; None if everything fits."""
    declared, known = experiment.groups, names(experiment)
    if declared == type(declared)():
        return None
    if len(known) < 2:
        return "groups: no factor is between participants; set `between = true` for one, or remove [groups]"
    for path, named in (("quotas", declared.quotas), ("answers", declared.answers.values())):
        unknown = next((name for name in named if name not in known), None)
        if unknown is not None:
            return f"groups.{path}: no group is called '{unknown}'{did_you_mean(unknown, known)}"
    if declared.question is None:
        return (
            ("groups.answers: allowed only with by = 'form:question'; remove it")
            if declared.answers
            else None
        )
    return _fault_of_question(experiment, declared.question)


def _questions(experiment: Experiment) -> list[tuple[DecidingQuestion, Question]]:
    """The questions before the trials, with their forms."""
    before = (form for form in experiment.forms if form.when == "before")
    return [(DecidingQuestion(form.name, field.name), field) for form in before for field in form.fields]


def _fault_of_question(experiment: Experiment, name: str) -> str | None:
    every = _questions(experiment)
    asked = [(where, field) for where, field in every if field.name == name]
    if not asked:
        near = did_you_mean(name, [where.field for where, _ in every])
        return f"groups.by: no form before the trials has the question '{name}'{near}"
    if len(asked) > 1:
        return f"groups.by: '{name}' occurs in two forms; rename the question that decides"
    [(where, field)] = asked
    if not isinstance(field, ChoiceField):
        return (
            f"groups.by: '{name}' is not a single-choice question; only such a question can decide the group"
        )
    if not field.required:
        return f"groups.by: '{name}' is optional; set `required = true`"
    return _fault_of_answers(experiment, where, field.values)


def _fault_of_answers(experiment: Experiment, where: DecidingQuestion, values: tuple[str, ...]) -> str | None:
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
                f"groups.answers: '{value}' leads to none of the groups {', '.join(known)}; set its group, "
                f"or refuse the answer with a [[screening]] rule"
            )
    return None
