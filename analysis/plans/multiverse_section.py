"""What a report says of the multiverse of exclusions."""

import numpy as np
from numpy.typing import NDArray

from analysis.plans.multiverse import MAX_RULES, Analyse, Multiverse, multiverse
from analysis.plans.plan import PlanRows
from analysis.plans.result import Analysis
from analysis.plans.sensitivity import MAX_RATINGS
from analysis.report.contents import Section, caption
from analysis.report.formats import Table
from analysis.report.numbers import p_value, share
from analysis.within.simple_effects import SIGNIFICANCE

TITLE = "Multiverse of exclusions"


def multiverse_section(analysis: Analysis, prepared: PlanRows, analyse: Analyse) -> Section:
    """The section of the report: how far the tests hang on the rules."""
    if not prepared.experiment.exclusions:
        return Section(TITLE, "The experiment declares no exclusion rule, so there is nothing to vary.")
    if len(prepared.checked.rows) > MAX_RATINGS:
        said = f"{len(prepared.checked.rows)} ratings exceed the limit of {MAX_RATINGS}."
        return Section(TITLE, f"Not computed: {said}")
    # matplotlib takes a second to import, which commands that draw nothing need not pay
    from analysis.report.multiverse_figure import multiverse_picture

    result = multiverse(prepared, analyse)
    choices = "every choice among" if len(result.rules) <= MAX_RULES else "leaving out one or all of"
    text = (
        f"The tests under {choices} the {len(result.rules)} declared exclusion rules: "
        f"{len(result.universes)} analyses. Manual exclusions always apply."
    )
    if result.n_failed:
        text += f" {result.n_failed} other choices could not be analyzed."
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
    kind = (
        ("Multivariate tests.")
        if analysis.multivariate_first
        else "p with the Greenhouse-Geisser correction."
    )
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
