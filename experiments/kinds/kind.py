"""The parts of a kind of trial. Everything else reads them from here."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from experiments.assignment import Compared, Trial
from experiments.columns.view import View
from experiments.declaration.base import Declaration
from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import Answer, BlockSpec, TrialDeclaration
from experiments.errors import InputError
from experiments.schema.effects import Effect


class PlanCommand(NamedTuple):
    """Arguments for `analysis`, and their assumptions in words."""

    arguments: list[str]
    assumed: str


MEDIUM_F = 0.25
"""Cohen's f of a medium effect."""


def power_of_means(experiment: Experiment) -> PlanCommand:
    """Power of tests of means: each factor by itself with a medium effect."""
    factors = [factor for factor in experiment.factors if len(factor.levels) > 1 and not factor.random]
    if not factors:
        raise InputError("power cannot be computed: no factor is compared")
    arguments = ["plan", "anova"]
    for option, between in (("--within", False), ("--between", True)):
        named = [f"{one.name}:{len(one.levels)}" for one in factors if one.between is between]
        arguments += [option, ",".join(named)] if named else []
    for factor in factors:
        arguments += ["--effect", f"{factor.name}={MEDIUM_F}"]
    # The same test that the report leads with.
    univariate = experiment.analysis.statistic == "univariate"
    arguments += ["--statistic", "greenhouse-geisser" if univariate else "multivariate"]
    alone = all(factor.between for factor in factors)
    means = "each participant gives one mean" if alone else "two means of a participant correlate by 0.5"
    return PlanCommand(
        arguments, f"each factor by itself has a medium effect (Cohen's f = {MEDIUM_F}), {means}"
    )


def nothing_wrong(experiment: Experiment) -> str | None:
    """For kinds whose declarations fit every experiment."""
    del experiment
    return None


def nothing_more(experiment: Experiment) -> tuple[str, ...]:
    """For kinds whose cells and exemplars already describe the plan."""
    del experiment
    return ()


def two_choices(experiment: Experiment) -> int:
    """Two choices, the minimum for an attention check."""
    del experiment
    return 2


def never(experiment: Experiment) -> bool:
    """By default, the trials of a kind do not depend on stored answers."""
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
        The effect of an edit of each key on stored answers, by path below [trial].
    page : type
        What the participant's page receives of the declaration.
    shown : callable
        Makes the page's model (`page`) from the declaration.
    assign : callable
        The trials of one participant in order, by declaration, seed and slot.
    block_size : callable
        Trials of one participant in a block, without attention checks.
    example : str
        A [trial] as TOML, for the reference; newcomers copy it.
    further_examples : tuple of str
        Examples of keys that exclude one another, so that the reference shows each.
    shares_clips : bool
        Whether it supports [assignment]; otherwise [assignment] is refused.
    groups : bool
        Whether it supports between-participant factors; otherwise they are refused.
    random_factors : bool
        Whether it supports random factors: assigns their levels, and analyzes them as random.
    plan : callable
        Lines that `stimuli plan` adds: expected counts; InputError if the design cannot be analyzed.
    adapts : bool
        Whether answers decide what is shown next: the server then follows its series.
    fault : callable
        What in the declared [trial] does not fit the rest of the experiment, as `path: what to do`, or None.
    doubt : callable
        What in the declared [trial] is possible but most likely a mistake, as `path: what to do`, or None.
    power : callable
        The `analysis plan` that computes the power of the declared design; InputError if that is impossible.
    chooses : callable
        Whether a run's trials are chosen by the comparisons stored before it.
    assign_by : callable or None
        Like `assign`, but with the stored comparisons; used if `chooses` is true.
    check_response : callable
        The number of a stored answer, for comparison with the number that an attention check requires.
    check_choices : callable
        How many numbers an attention check can require.
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
    doubt: Callable[[Experiment], str | None] = nothing_wrong
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
        """Its name in the TOML, the database and the API."""
        return str(self.declaration.model_fields["kind"].default)
