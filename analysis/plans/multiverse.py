"""The multiverse of exclusions: the same tests with every choice among the declared rules.

Source: Steegen, Tuerlinckx, Gelman & Vanpaemel (2016), doi:10.1177/1745691616658637.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Protocol

from analysis.plans.exclusions import Exclusions, judge_rows
from analysis.plans.plan import PlanRows
from analysis.plans.result import plans_multivariate
from analysis.within.anova import AnovaResult, Effect
from analysis.within.cell_means import CellTable
from analysis.within.simple_effects import first_p, first_test, reports_multivariate
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError

MAX_RULES = 6
"""With more rules each is left out alone, and all are: 2 to the power of their number would keep waiting."""


@dataclass(frozen=True)
class Universe:
    """One choice among the declared rules, and the tests it leads to.

    Attributes
    ----------
    applied : tuple of bool
        For each declared rule, whether this choice applies it.
    n_participants, n_ratings : int
    p_values, sizes : tuple of float
        Greenhouse-Geisser's p and partial eta squared of each effect.
    declared : bool
        Whether it is the choice of the declaration: all rules.
    """

    applied: tuple[bool, ...]
    n_participants: int
    n_ratings: int
    p_values: tuple[float, ...]
    sizes: tuple[float, ...]

    @property
    def declared(self) -> bool:
        """True for the choice that the experiment declares."""
        return all(self.applied)


@dataclass(frozen=True)
class Multiverse:
    """Every choice that could be analyzed, and how many could not."""

    rules: tuple[str, ...]
    effects: tuple[tuple[str, ...], ...]
    universes: tuple[Universe, ...]
    n_failed: int


class TestedSample(Protocol):
    """What an analysis of prepared rows must have: who remains, and the tests."""

    @property
    def cells(self) -> CellTable:
        """Cell means of those who remain."""

    @property
    def anova(self) -> AnovaResult:
        """Every effect."""


Analyse = Callable[[PlanRows], TestedSample]


def multiverse(prepared: PlanRows, analyse: Analyse) -> Multiverse:
    """Analyze under every choice among the declared exclusion rules.

    Parameters
    ----------
    prepared : Prepared
        With the answers before exclusion.
    analyse : callable
        From prepared rows to their analysis; an InputError of it makes a choice count as failed.

    Returns
    -------
    Multiverse
        The declared choice first; then fewer and fewer rules.
    """
    experiment, universes, failed = prepared.experiment, list[Universe](), 0
    effects: tuple[tuple[str, ...], ...] = ()
    choose, multivariate = _Choice(prepared, analyse), False
    for applied in _choices(len(experiment.exclusions)):
        try:
            anova, n_ratings = choose(applied)
        except InputError:
            failed += 1
            continue
        if not effects:
            effects = tuple(effect.factors for effect in anova.effects)
            multivariate = reports_multivariate(anova, plans_multivariate(experiment))
        tests = [anova.effect(":".join(factors)) for factors in effects]
        universes.append(
            Universe(
                applied,
                anova.n_participants,
                n_ratings,
                tuple(first_p(test, multivariate) for test in tests),
                tuple(_size(test, multivariate) for test in tests),
            )
        )
    return Multiverse(rule_names(experiment), effects, tuple(universes), failed)


def _size(effect: Effect, multivariate: bool) -> float:
    """Partial eta squared of the test reported first."""
    test = first_test(effect, multivariate)
    return effect.eta_sq_partial if test is None else test.eta_sq_partial


def _choices(n_rules: int) -> Iterator[tuple[bool, ...]]:
    """All rules first; every choice of few rules, else each left out alone and none applied."""
    if n_rules <= MAX_RULES:
        yield from product((True, False), repeat=n_rules)
        return
    yield (True,) * n_rules
    for left_out in range(n_rules):
        yield tuple(rule != left_out for rule in range(n_rules))
    yield (False,) * n_rules


class _Choice:
    """Analyses under choices of rules: a rule judges once, choices that keep the same rows share one."""

    def __init__(self, prepared: PlanRows, analyse: Analyse) -> None:
        self._prepared, self._analyse = prepared, analyse
        whole = judge_rows(prepared.experiment, prepared.checked)
        # Numbered from 0: the index then says which rows a choice keeps.
        self._judged = replace(whole, main=whole.main.reset_index(drop=True))
        self._known: dict[bytes, tuple[AnovaResult, int] | InputError] = {}

    def __call__(self, applied: tuple[bool, ...]) -> tuple[AnovaResult, int]:
        exclusions = self._judged.under(applied)
        key = exclusions.rows.index.to_numpy().tobytes()
        if key not in self._known:
            try:
                self._known[key] = self._of(applied, exclusions)
            except InputError as error:
                self._known[key] = error
        known = self._known[key]
        if isinstance(known, InputError):
            raise known
        return known

    def _of(self, applied: tuple[bool, ...], exclusions: Exclusions) -> tuple[AnovaResult, int]:
        declared = self._prepared.experiment
        chosen = tuple(rule for rule, applies in zip(declared.exclusions, applied, strict=True) if applies)
        experiment = declared.model_copy(update={"exclusions": chosen})
        tested = self._analyse(
            replace(self._prepared, experiment=experiment, exclusions=exclusions, decisions=())
        )
        kept = exclusions.rows["participant"].isin(list(tested.cells.participants))
        return tested.anova, int(kept.sum())


def rule_names(experiment: Experiment) -> tuple[str, ...]:
    """What the declared rules are called, numbered where two are of one kind."""
    kinds = [rule.rule for rule in experiment.exclusions]
    return tuple(
        kind if kinds.count(kind) == 1 else f"{kind} ({kinds[: position + 1].count(kind)})"
        for position, kind in enumerate(kinds)
    )
