"""What all figures share: colours, style, and bytes that do not differ from run to run."""

from collections.abc import Callable
from io import BytesIO
from textwrap import wrap
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from analysis.report.letters import FONT, further_letters

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6A00", "#444444")
"""Okabe and Ito's palette, told apart with every common colour vision; markers tell levels apart as well."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
STYLE: dict[Any, Any] = {
    "font.family": FONT,
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "palpebra",
    "svg.fonttype": "path",
    "axes.linewidth": 0.8,
    "text.parse_math": False,  # `$` in a level's name is a sign of money, not the start of a formula
}
NOTE_CHARACTERS = 18
"""Characters of a note (7 points) in an inch."""
LEAST_CHARACTERS = 6
BESIDE: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}


def new_figure(width: float = 7.2, height: float = 4.4) -> Figure:
    """An empty figure; draw on it within `mpl.rc_context(STYLE)`."""
    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def wrapped(text: str, characters: int) -> str:
    """The text in lines of at most so many characters, each of its own lines by itself."""
    lines = [
        piece
        for line in text.split("\n")
        for piece in wrap(line, max(characters, LEAST_CHARACTERS), break_on_hyphens=False) or [""]
    ]
    return "\n".join(lines)


def write_note(figure: Figure, note: str, synthetic: bool, what: str = "ratings") -> None:
    """A note below the figure, under a mark where no person gave the data."""
    mark = f"SYNTHETIC DATA: no person gave these {what}.\n" if synthetic else ""
    note = wrapped(note, int(NOTE_CHARACTERS * figure.get_figwidth()))
    figure.supxlabel(mark + note, fontsize=7, color="#8a1c1c" if synthetic else "#555555")


def in_both_formats(figure: Figure) -> tuple[bytes, bytes]:
    """The figure as SVG and as PNG, without anything that differs from run to run.

    Each is drawn once and laid out once: `savefig` draws twice, and lays out each time.
    """
    svg, png, dpi = BytesIO(), BytesIO(), figure.dpi
    with mpl.rc_context(STYLE), further_letters(figure):
        _drawn(FigureCanvasSVG(figure).print_svg, svg, {"Date": None, "Creator": None})
        figure.set_layout_engine("none")
        figure.dpi = dpi  # an SVG has 72
        _drawn(FigureCanvasAgg(figure).print_png, png, {"Software": None})
    return svg.getvalue(), png.getvalue()


def _drawn(by: Callable[..., None], into: BytesIO, metadata: dict[str, None]) -> None:
    by(into, metadata=metadata)
