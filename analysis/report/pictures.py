"""What all figures share: colours, style, and bytes that do not differ from run to run."""

from io import BytesIO
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6A00", "#444444")
"""Okabe and Ito's palette, told apart with every common colour vision; markers tell levels apart as well."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "palpebra",
    "svg.fonttype": "path",
    "axes.linewidth": 0.8,
}
BESIDE: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}


def new_figure(width: float = 7.2, height: float = 4.4) -> Figure:
    """An empty figure; draw on it within `mpl.rc_context(STYLE)`."""
    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_note(figure: Figure, note: str, synthetic: bool, what: str = "ratings") -> None:
    """A note below the figure, under a mark where no person gave the data."""
    mark = f"SYNTHETIC DATA: no person gave these {what}.\n" if synthetic else ""
    figure.supxlabel(mark + note, fontsize=7, color="#8a1c1c" if synthetic else "#555555")


def as_bytes(figure: Figure, kind: Literal["png", "svg"]) -> bytes:
    """The figure as PNG or SVG without anything that differs from run to run."""
    buffer = BytesIO()
    metadata = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format=kind, metadata=metadata)
    return buffer.getvalue()
