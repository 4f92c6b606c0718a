"""What a kind of trial is made of. Everything else reads it from here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from experiments.assignment.trial import Compared, Trial
from experiments.columns.view import View
from experiments.declaration.base import Declaration
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import Answer, BlockSpec, TrialDeclaration
from experiments.errors import InputError
from experiments.schema.effects import Effect


class PlanCommand(NamedTuple):
    """Arguments behind `analysis`, and in words what they assume."""

    arguments: list[str]
    assumed: str


MEDIUM_F = 0.25
"""Cohen's f that is called medium."""


def power_of_means(experiment: Experiment) -> PlanCommand:
    """Power of tests of means: each factor by itself with a medium effect."""
    factors = [factor for factor in experiment.factors if len(factor.levels) > 1 and not factor.random]
    if not factors:
        raise InputError("there is no factor whose levels are compared, so there is no power to reckon")
    arguments = ["plan", "anova"]
    for option, between in (("--within", False), ("--between", True)):
        named = [f"{one.name}:{len(one.levels)}" for one in factors if one.between is between]
        arguments += [option, ",".join(named)] if named else []
    for factor in factors:
        arguments += ["--effect", f"{factor.name}={MEDIUM_F}"]
    alone = all(factor.between for factor in factors)
    means = "each participant gives one mean" if alone else "two means of a participant correlate by 0.5"
    return PlanCommand(
        arguments, f"each factor by itself has a medium effect (Cohen's f = {MEDIUM_F}), {means}"
    )


def nothing_wrong(experiment: Experiment) -> str | None:
    """Kinds of which every declaration fits every experiment."""
    del experiment
    return None


def nothing_more(experiment: Experiment) -> tuple[str, ...]:
    """What a plan says of a kind whose trials the cells and exemplars tell already."""
    del experiment
    return ()


def two_choices(experiment: Experiment) -> int:
    """The answers that an attention check offers at least."""
    del experiment
    return 2


def never(experiment: Experiment) -> bool:
    """No kind's trials depend on what is stored unless it says so."""
    del experiment
    return False


# Decision 0322: Trial kinds are found by name.
@dataclass(frozen=True)
class Kind:
    """A kind of trial.

    Attributes
    ----------
    declaration : type
        The model of the TOML's [trial]; the constant of its `kind` is the name.
    answer : type
        The model of what a participant answers to one trial, and how that is stored.
    view : View
        The rows it exports.
    roles : tuple of str
        The clips a trial shows, in the order of their places (`shown`; `left`, `right`).
    effects : mapping of str to {"wording", "measured"}
        What an edit of each key of the declaration does to stored answers, by path below [trial].
    page : type
        What of the declaration the participant's page is told.
    shown : callable
        Makes the page's model (`page`) from the declaration.
    assign : callable
        The trials of one participant in order, by declaration, seed and slot.
    block_size : callable
        Trials of one participant in a block, attention checks not counted.
    example : str
        A [trial] as TOML, for the reference; it is what a newcomer copies.
    further_examples : tuple of str
        Of keys that exclude one another, so that the reference shows each.
    shares_clips : bool
        Whether it follows [assignment]; else that is refused.
    groups : bool
        Whether it follows factors between participants; else they are refused.
    random_factors : bool
        Whether it follows random factors: deals their levels, and analyses them as random.
    plan : callable
        Lines that `stimuli plan` adds: expected counts; InputError where the design cannot be analysed.
    adapts : bool
        Whether answers decide what is shown next: the server then follows its series.
    fault : callable
        What in the declared [trial] does not fit the rest of the experiment: `path: what to do`, or None.
    power : callable
        The `analysis plan` that gives the power of the declared design; InputError where it cannot be
        computed.
    chooses : callable
        Whether a run's trials are chosen by the comparisons stored before it.
    assign_by : callable or None
        As `assign`, with the comparisons stored before, where `chooses` says so.
    check_response : callable
        The number that an answer, as stored, is to an attention check, which asks for one.
    check_choices : callable
        How many numbers an attention check may ask for.
    """

    declaration: type[TrialDeclaration]
    answer: type[Answer]
    view: View
    roles: tuple[str, ...]
    effects: Mapping[str, Effect]
    page: type[Declaration]
    shown: Callable[[Experiment], Declaration]
    assign: Callable[[Experiment, int, int], list[Trial]]
    block_size: Callable[[Experiment, BlockSpec], int]
    example: str
    further_examples: tuple[str, ...] = ()
    plan: Callable[[Experiment], tuple[str, ...]] = nothing_more
    fault: Callable[[Experiment], str | None] = nothing_wrong
    power: Callable[[Experiment], PlanCommand] = power_of_means
    check_response: Callable[[Mapping[str, Any]], int | None] = lambda _: None
    check_choices: Callable[[Experiment], int] = two_choices
    shares_clips: bool = False
    groups: bool = False
    random_factors: bool = False
    adapts: bool = False
    chooses: Callable[[Experiment], bool] = never
    assign_by: Callable[[Experiment, int, int, Sequence[Compared]], list[Trial]] | None = None

    @property
    def name(self) -> str:
        """As the TOML, the database and the API name it."""
        return str(self.declaration.model_fields["kind"].default)
