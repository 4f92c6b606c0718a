"""The multiverse of exclusions: the same tests with every choice among the declared rules.

Source: Steegen, Tuerlinckx, Gelman & Vanpaemel (2016), doi:10.1177/1745691616658637.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Protocol

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from analysis.plans.exclusions import Exclusions, judged
from analysis.plans.plan import Prepared
from analysis.plans.result import Analysis, plans_multivariate
from analysis.plans.sensitivity import MAX_RATINGS
from analysis.report.contents import Picture, Section, caption
from analysis.report.formats import Table
from analysis.report.numbers import p_value, share
from analysis.report.pictures import (
    BESIDE,
    COLOURS,
    MARKERS,
    STYLE,
    in_both_formats,
    new_figure,
    wrapped,
    write_note,
)
from analysis.within.anova import AnovaResult
from analysis.within.cell_means import CellTable
from analysis.within.effects import Effect
from analysis.within.simple_effects import SIGNIFICANCE, first_p, first_test, reports_multivariate
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
    """Every choice that could be analysed, and how many could not."""

    rules: tuple[str, ...]
    effects: tuple[tuple[str, ...], ...]
    universes: tuple[Universe, ...]
    n_failed: int


class Tested(Protocol):
    """What an analysis of prepared rows must have: who remains, and the tests."""

    @property
    def cells(self) -> CellTable:
        """Cell means of those who remain."""

    @property
    def anova(self) -> AnovaResult:
        """Every effect."""


Analyse = Callable[[Prepared], Tested]


def multiverse(prepared: Prepared, analyse: Analyse) -> Multiverse:
    """Analyse under every choice among the declared exclusion rules.

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

    def __init__(self, prepared: Prepared, analyse: Analyse) -> None:
        self._prepared, self._analyse = prepared, analyse
        whole = judged(prepared.experiment, prepared.checked)
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


# What a report says of the multiverse of exclusions.

TITLE = "Multiverse of exclusions"


def multiverse_section(analysis: Analysis, prepared: Prepared, analyse: Analyse) -> Section:
    """The section of the report: how far the tests hang on the rules."""
    if not prepared.experiment.exclusions:
        return Section(TITLE, "The experiment declares no exclusion rule, so that there is nothing to vary.")
    if len(prepared.checked.rows) > MAX_RATINGS:
        said = f"{len(prepared.checked.rows)} ratings are more than {MAX_RATINGS}."
        return Section(TITLE, f"Not computed: {said}")
    # matplotlib takes a second to import, which commands that draw nothing need not pay

    result = multiverse(prepared, analyse)
    choices = "every choice among" if len(result.rules) <= MAX_RULES else "leaving out one or all of"
    text = (
        f"The tests under {choices} the {len(result.rules)} declared exclusion rules: "
        f"{len(result.universes)} analyses. Exclusions by hand always apply."
    )
    if result.n_failed:
        text += f" {result.n_failed} further choices could not be analysed."
    picture = multiverse_picture(analysis, result)
    return Section(TITLE, text, (_table(analysis, result),), (picture,))


def _table(analysis: Analysis, result: Multiverse) -> Table:
    p = np.array([universe.p_values for universe in result.universes])
    sizes = np.array([universe.sizes for universe in result.universes])
    declared = next(universe for universe in result.universes if universe.declared)
    rows = tuple(
        (
            analysis.labels.effect(factors),
            p_value(declared.p_values[i]),
            _range([p_value(value) for value in _ends(p[:, i])]),
            f"{int((p[:, i] < SIGNIFICANCE).sum())} of {len(p)}",
            _range([share(value) for value in _ends(sizes[:, i])]),
        )
        for i, factors in enumerate(result.effects)
    )
    kind = "Multivariate tests." if analysis.multivariate_first else "p by Greenhouse-Geisser."
    people = [universe.n_participants for universe in result.universes]
    header = ("Effect", "p as declared", "p", f"significant at {share(SIGNIFICANCE, 2)}", "partial η²")
    notes = (f"N = {_range([str(min(people)), str(max(people))])}. {kind}",)
    title = caption("Tests under other exclusions", analysis.name, analysis.synthetic)
    return Table("multiverse", title, header, rows, 1, notes)


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """Smallest and largest of the values there are; NaN where there is none."""
    given = values[np.isfinite(values)]
    return (float(given.min()), float(given.max())) if given.size else (np.nan, np.nan)


def _range(ends: list[str]) -> str:
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


# The figure of a multiverse: p of every effect under every choice of rules, over the rules applied.

SMALLEST = 1e-4
"""Smaller p are drawn here."""

LEGEND_CHARACTERS, RULE_CHARACTERS = 26, 24
LINE_INCHES = 0.13
"""Height of a line of 7 points."""

MAX_EFFECTS = len(COLOURS)
"""Of more effects those with the smallest p as declared are drawn; the table has all."""


def multiverse_picture(analysis: Analysis, result: "Multiverse") -> Picture:
    """Draw p of the effects above a dot for each rule that was applied; choices ordered by who remains."""
    order = sorted(result.universes, key=lambda u: (u.n_participants, u.n_ratings, u.applied), reverse=True)
    with mpl.rc_context(STYLE):
        p = np.array([universe.p_values for universe in order])
        drawn = _drawn(p[[universe.declared for universe in order]][0])
        names = [wrapped(analysis.labels.effect(result.effects[i]), LEGEND_CHARACTERS) for i in drawn]
        rules = [wrapped(name.replace("_", " "), RULE_CHARACTERS) for name in result.rules]
        # as high as the lines of the legend, and of the names of rules, need
        above = max(2.4, LINE_INCHES * 1.25 * sum(_lines(name) for name in names) + 0.3)
        below = max(0.4, sum(LINE_INCHES * _lines(rule) + 0.1 for rule in rules))
        figure = new_figure(7.2, above + below + 0.8)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[above, below])
        _tests(upper, p[:, drawn], names)
        _rules(lower, np.array([universe.applied for universe in order]), rules)
        declared = next(at for at, universe in enumerate(order) if universe.declared)
        for axes in (upper, lower):
            axes.axvline(declared, color="#999999", linewidth=5, alpha=0.25, zorder=0)
        low, high = order[-1].n_participants, order[0].n_participants
        note = f"A column is a choice of exclusion rules, N from {high} to {low}; shaded: as declared."
        if len(drawn) < p.shape[1]:
            note += f" The {len(drawn)} effects of {p.shape[1]} with the smallest p as declared."
        write_note(figure, note, analysis.synthetic)
    what = "p of every effect under each choice among the declared exclusion rules"
    return Picture(
        "figure-multiverse",
        "Multiverse of exclusions",
        what,
        *in_both_formats(figure),
    )


def _drawn(p_declared: np.ndarray) -> list[int]:
    """Positions of the effects to draw, in the order of the table."""
    return sorted(np.argsort(p_declared, kind="stable")[:MAX_EFFECTS].tolist())


def _lines(text: str) -> int:
    return text.count("\n") + 1


def _tests(axes: Axes, p: np.ndarray, names: list[str]) -> None:
    columns = np.arange(len(p))
    for i, name in enumerate(names):
        axes.plot(
            columns,
            np.maximum(p[:, i], SMALLEST),
            color=COLOURS[i % len(COLOURS)],
            marker=MARKERS[i % len(MARKERS)],
            markersize=3.5,
            linewidth=0.6,
            label=name,
        )
    axes.axhline(SIGNIFICANCE, color="#555555", linewidth=0.8, linestyle="--")
    axes.set_yscale("log")
    axes.set_ylim(SMALLEST * 0.7, 1.3)
    ticks = [SMALLEST, 0.001, 0.01, SIGNIFICANCE, 0.1, 1]
    axes.set_yticks(ticks, ["≤ .0001", ".001", ".01", ".05", ".1", "1"])
    axes.minorticks_off()
    axes.set_ylabel("p", style="italic")
    axes.legend(**BESIDE, frameon=False, fontsize=7)


def _rules(axes: Axes, applied: np.ndarray, names: list[str]) -> None:
    column, rule = np.nonzero(applied)
    axes.plot(column, rule, linestyle="none", marker="o", markersize=3.5, color="#333333")
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)
