"""The power curves of a simulation as one figure."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.power.simulate import PowerResult
from analysis.report.pictures import COLOURS, MARKERS, STYLE, further_letters
from experiments.errors import InputError
from experiments.files import whole_file

FORMATS = (".png", ".svg", ".pdf")


def draw_power(result: PowerResult, target: float = 0.8) -> Figure:
    """Power against n, a line an effect, with two standard errors of the simulation either side."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 4.2), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.axhline(target, color="#888888", linewidth=0.8, linestyle="--")
        axes.axhline(result.alpha, color="#888888", linewidth=0.8, linestyle=":")
        for i, effect in enumerate(result.effects):
            colour, row, se = COLOURS[i % len(COLOURS)], result.power[i], result.se[i]
            axes.fill_between(result.n, row - 2 * se, row + 2 * se, color=colour, alpha=0.15, linewidth=0)
            axes.plot(
                result.n, row, color=colour, marker=MARKERS[i % len(MARKERS)], markersize=4, label=effect
            )
        axes.set_ylim(0, 1.02)
        axes.set_yticks(np.linspace(0, 1, 6))
        axes.set_xlabel("participants")
        axes.set_ylabel(f"power at α = {result.alpha:g}")
        axes.set_title(
            f"{result.experiment}: {result.statistic}, {result.simulations} synthetic data sets per point",
            fontsize=9.5,
            loc="left",
        )
        figure.legend(loc="outside right upper", frameon=False)
    return figure


def save_power_figure(result: PowerResult, path: Path, target: float = 0.8) -> None:
    """Write the figure as PNG, SVG or PDF by the file's ending, whole or not at all."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a name ending in {', '.join(FORMATS)}")
    undated: dict[str, Any] = {
        ".svg": {"Date": None},
        ".pdf": {"CreationDate": None},
        ".png": {"Software": None},
    }
    figure = draw_power(result, target)
    with whole_file(path) as temporary, mpl.rc_context(STYLE), further_letters(figure):
        figure.savefig(temporary, dpi=200, metadata=undated[path.suffix.lower()])
