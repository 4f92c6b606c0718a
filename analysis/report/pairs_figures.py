"""Figures of paired comparisons. The same data give the same bytes."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np

from analysis.pairs.abilities import Z_95, PairsResult
from analysis.pairs.findings import PairCount
from analysis.report.contents import Picture
from analysis.report.pictures import COLOURS, STYLE, in_both_formats, new_figure, write_note

NUMBERED_MAX = 14
"""More items than this and the shares are colors without numbers."""


def draw_abilities(result: PairsResult, synthetic: bool, people: int) -> Picture:
    """Abilities against their mean with 95% intervals, the ablest on top."""
    ranked = sorted(result.items, key=lambda item: (-item.rank, item.name))
    with mpl.rc_context(STYLE):
        figure = new_figure(7.2, 1.5 + 0.32 * len(ranked))
        axes = figure.add_subplot()
        rows = range(len(ranked))
        axes.axvline(0, color="#999999", linewidth=0.8, zorder=1)
        axes.errorbar(
            [item.centred for item in ranked],
            rows,
            xerr=[Z_95 * item.se_centred for item in ranked],
            linestyle="none",
            marker="o",
            color=COLOURS[0],
            capsize=3.2,
            elinewidth=1.3,
            markersize=5,
        )
        axes.set_yticks(rows, [item.name for item in ranked])
        axes.set_xlabel(f"Ability relative to the mean, {result.scale}")
        axes.grid(axis="x", linewidth=0.4, alpha=0.5)
        axes.set_axisbelow(True)
        note = f"N = {people}, {result.n_comparisons} comparisons. Bars: 95% intervals, sum-to-zero."
        write_note(figure, note, synthetic, "comparisons")
        best = ranked[-1].name
        alt = f"Abilities of {len(ranked)} cells with 95% intervals; {best} was chosen most often"
        return Picture("figure-abilities", "Abilities", alt, *in_both_formats(figure))


def draw_choices(pairs: Sequence[PairCount], synthetic: bool, people: int) -> Picture:
    """Share of comparisons in which the row's cell was chosen over the column's, ties as half."""
    names = list(dict.fromkeys(name for pair in pairs for name in (pair.first, pair.second)))
    shares = np.full((len(names), len(names)), np.nan)
    for pair in pairs:
        one, other = names.index(pair.first), names.index(pair.second)
        shares[one, other] = (pair.first_chosen + pair.ties / 2) / pair.n
        shares[other, one] = 1 - shares[one, other]
    size = len(names)
    with mpl.rc_context(STYLE):
        figure = new_figure(7.2, 2.0 + 0.34 * size)
        axes = figure.add_subplot()
        drawn = axes.imshow(shares, cmap="PuOr", vmin=0, vmax=1)
        axes.set_xticks(range(size), names, rotation=30, ha="right")
        axes.set_yticks(range(size), names)
        axes.set_xlabel("over")
        axes.set_ylabel("chosen")
        for (row, column), share in np.ndenumerate(shares):
            if np.isfinite(share) and size <= NUMBERED_MAX:
                ink = "white" if abs(share - 0.5) > 0.3 else "black"
                axes.text(column, row, f"{share:.2f}", ha="center", va="center", fontsize=8, color=ink)
        axes.spines[:].set_visible(False)
        figure.colorbar(drawn, ax=axes, label="share chosen")
        write_note(figure, f"N = {people}. A tie counts as half a choice for each.", synthetic, "comparisons")
        alt = "Proportion of comparisons in which the row's cell was chosen over the column's cell"
        return Picture(
            "figure-choices",
            "Choices in each pair",
            alt,
            *in_both_formats(figure),
        )
