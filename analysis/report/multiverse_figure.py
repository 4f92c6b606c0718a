"""The figure of a multiverse: p of every effect under every choice of rules, over the rules applied."""

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from analysis.plans.result import Analysis
from analysis.report.contents import Picture
from analysis.report.pictures import (
    BESIDE,
    COLOURS,
    MARKERS,
    STYLE,
    in_both_formats,
    new_figure,
    wrap_text,
    write_note,
)
from analysis.within.simple_effects import SIGNIFICANCE

if TYPE_CHECKING:
    from analysis.plans.multiverse import Multiverse

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
        names = [wrap_text(analysis.labels.effect(result.effects[i]), LEGEND_CHARACTERS) for i in drawn]
        rules = [wrap_text(name.replace("_", " "), RULE_CHARACTERS) for name in result.rules]
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
        note = f"Each column is one choice of exclusion rules, N from {high} to {low}; shaded: as declared."
        if len(drawn) < p.shape[1]:
            note += f" The {len(drawn)} effects of {p.shape[1]} with the smallest p as declared."
        write_note(figure, note, analysis.synthetic)
    what = "p of every effect under each choice of the declared exclusion rules"
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
