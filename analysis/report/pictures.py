"""What all figures share: colors, style, and bytes that do not differ from run to run."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib import font_manager
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter
from numpy.typing import NDArray
from scipy import special

from analysis.report.contents import Picture
from experiments.errors import InputError
from experiments.files import whole_file
from table_files import counted

if TYPE_CHECKING:  # every figure would wait for what simulations import
    from analysis.power.simulate import PowerResult

Floats = NDArray[np.float64]

# Letters of names in figures: which of them the figures' own font lacks, and what draws those.

FONT = "DejaVu Sans"
"""Comes with matplotlib: Latin, Greek, Cyrillic, Arabic, hardly any Chinese, Japanese or Korean."""

_NOTE = "Letters without an installed font are shown as their code points (U+...)."


def _charmap(path: str) -> frozenset[int]:
    return frozenset(font_manager.get_font(path).get_charmap())


def missing_characters(texts: list[str]) -> set[str]:
    """The characters of `texts` that the figures' own font lacks; those that print nothing aside."""
    known = _charmap(font_manager.findfont(FONT))
    characters = set("".join(texts))
    return {one for one in characters if one.isprintable() and not one.isspace() and ord(one) not in known}


def _further_fonts(letters: set[str]) -> tuple[list[str], set[str]]:
    """Families installed here that have the letters, in the order of their names, and what is left."""
    families: list[str] = []
    left = set(letters)
    installed = font_manager.fontManager.ttflist
    regular = [font for font in installed if font.style == "normal" and font.weight in (400, "normal")]
    for font in sorted(regular, key=lambda one: ("CJK" not in one.name, "Sans" not in one.name, one.name)):
        if not left:
            break
        codes = _charmap(font.fname)
        drawn = {letter for letter in left if ord(letter) in codes}
        if drawn and "LastResort" not in font.name.replace(" ", ""):
            families.append(font.name)
            left -= drawn
    return families, left


def _as_numbers(text: str, left: set[str]) -> str:
    return "".join(f"[U+{ord(one):04X}]" if one in left else one for one in text)


def _add_to_note(figure: Figure) -> None:
    note = figure.get_supxlabel()
    if not note:
        figure.supxlabel(_NOTE, fontsize=7)
    for text in figure.texts:
        if note and text.get_text() == note:
            text.set_text(f"{note}\n{_NOTE}")


@contextmanager
def further_letters(figure: Figure) -> Iterator[None]:
    """Within it the figure is drawn with fonts of this machine for the letters that its own font lacks.

    A letter that no font here has is shown as its code point, with a note in the figure: two levels of boxes
    could not be distinguished. A figure whose letters its own font has is drawn as it is, whatever is
    installed.
    """
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text)]
    letters = missing_characters([text.get_text() for text in texts])
    if not letters:
        yield
        return
    families, left = _further_fonts(letters)
    if left:
        _add_to_note(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            labels = [_as_numbers(label.get_text(), left) for label in axis.get_ticklabels()]
            if any(labels) and isinstance(axis.get_major_formatter(), FuncFormatter | FixedFormatter):
                axis.set_ticks(axis.get_majorticklocs(), labels=labels)
    for text in figure.findobj(Text):
        if isinstance(text, Text):
            text.set_text(_as_numbers(text.get_text(), left))
            text.set_fontfamily([FONT, *families])
    with mpl.rc_context({"font.family": [FONT, *families]}):
        yield


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F6A00", "#444444")
"""Okabe and Ito's palette, distinguishable with every common color vision; markers also distinguish
levels."""
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


def wrap_text(text: str, characters: int) -> str:
    """The text in lines of at most so many characters; its line breaks are kept."""
    lines = [
        piece
        for line in text.split("\n")
        for piece in wrap(line, max(characters, LEAST_CHARACTERS), break_on_hyphens=False) or [""]
    ]
    return "\n".join(lines)


def write_note(figure: Figure, note: str, synthetic: bool, what: str = "ratings") -> None:
    """A note below the figure, under a mark where no person gave the data."""
    mark = f"SYNTHETIC DATA: no person gave these {what}.\n" if synthetic else ""
    # Lines by characters, since the width of a text is known only when it is drawn.
    note = wrap_text(note, int(NOTE_CHARACTERS * figure.get_figwidth()))
    figure.supxlabel(mark + note, fontsize=7, color="#8a1c1c" if synthetic else "#555555")


def in_both_formats(figure: Figure) -> tuple[bytes, bytes]:
    """The figure as SVG and as PNG, without anything that differs from run to run.

    Each is drawn once and laid out once: `savefig` draws twice, and lays out each time.
    """
    svg, png, dpi = BytesIO(), BytesIO(), figure.dpi
    with mpl.rc_context(STYLE), further_letters(figure):
        _drawn(FigureCanvasSVG(figure).print_svg, svg, {"Date": None, "Creator": None})
        # The layout of the first drawing holds for the second.
        figure.set_layout_engine("none")
        figure.dpi = dpi  # an SVG has 72
        _drawn(FigureCanvasAgg(figure).print_png, png, {"Software": None})
    return svg.getvalue(), png.getvalue()


def _drawn(by: Callable[..., None], into: BytesIO, metadata: dict[str, None]) -> None:
    by(into, metadata=metadata)


# Figures of one command: estimates with intervals, and every person's mean in each level.


def spread_offsets(n: int) -> Floats:
    """Evenly spread offsets in [-1, 1] in an order that looks random and is not."""
    # Steps of the golden ratio fill an interval evenly at any number.
    golden = np.arange(1, n + 1) * 0.6180339887498949
    spread: Floats = 2 * (golden - np.floor(golden)) - 1
    return spread


def draw_estimates(
    key: str,
    caption: str,
    axis: str,
    rows: Sequence[tuple[str, float, float, float]],
    note: str,
    synthetic: bool,
    *,
    what: str = "ratings",
    alt: str = "",
    reference: float | None = None,
) -> Picture:
    """Estimates with intervals, the first on top.

    Parameters
    ----------
    key, caption : str
        File stem and title.
    axis : str
        What the estimates are, with the unit.
    rows : sequence of (name, estimate, low, high)
    note : str
        Below the figure: what the bars are.
    synthetic : bool
        Whether no person gave the data; marked.
    what : str
        What people gave.
    alt : str
        The figure in words; by default the range of the estimates.
    reference : float, optional
        Where a line is drawn, such as at no difference.
    """
    ends = list(reversed(rows))
    with mpl.rc_context(STYLE):
        figure = new_figure(7.2, 1.5 + 0.32 * len(ends))
        axes = figure.add_subplot()
        if reference is not None:
            axes.axvline(reference, color="#999999", linewidth=0.8, zorder=1)
        values = np.array([row[1:] for row in ends], dtype=np.float64)
        # A limit that does not exist leaves the point without its bar on that side.
        reach = np.nan_to_num(np.abs(values[:, 1:] - values[:, :1]), posinf=0.0)
        bars: dict[str, Any] = {"color": COLOURS[0], "capsize": 3.2, "elinewidth": 1.3, "markersize": 5}
        axes.errorbar(values[:, 0], range(len(ends)), xerr=reach.T, linestyle="none", marker="o", **bars)
        axes.set_yticks(range(len(ends)), [row[0] for row in ends])
        axes.set_xlabel(axis)
        axes.grid(axis="x", linewidth=0.4, alpha=0.5)
        axes.set_axisbelow(True)
        write_note(figure, note, synthetic, what)
        span = f"from {values[:, 0].min():.3g} to {values[:, 0].max():.3g}"
        alt = alt or f"{axis}: {counted(len(rows), 'estimate')} with intervals, {span}"
        return Picture(key, caption, alt, *in_both_formats(figure))


def draw_people(
    caption: str, axis: str, levels: Sequence[tuple[str, Floats]], center: str, synthetic: bool
) -> Picture:
    """Every person's value in each level, and the level's mean with its 95% t interval, or its median.

    Parameters
    ----------
    caption, axis : str
        Title, and what the values are.
    levels : sequence of (name, values (n,))
    center : {"mean", "median"}
    synthetic : bool
        Whether no person gave the data; marked.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(max(3.6, 1.4 + 0.9 * len(levels)), 4.0)
        axes = figure.add_subplot()
        for at, (_, values) in enumerate(levels):
            offsets = 0.16 * spread_offsets(len(values))
            faint: dict[str, Any] = {"alpha": 0.3, "markersize": 3.5, "markeredgewidth": 0}
            axes.plot(at + offsets, values, "o", color=COLOURS[0], **faint)
            if center == "median":
                axes.plot([at - 0.25, at + 0.25], [np.median(values)] * 2, color=COLOURS[0], linewidth=2)
            else:
                n = len(values)
                reach = float(special.stdtrit(n - 1, 0.975)) if n > 1 else 0.0
                half = reach * values.std(ddof=min(1, n - 1)) / np.sqrt(n)
                axes.errorbar(at, values.mean(), half, marker="o", color=COLOURS[0], capsize=4, markersize=7)
        axes.set_xticks(range(len(levels)), [wrap_text(name, 14) for name, _ in levels])
        axes.set_xlim(-0.6, len(levels) - 0.4)
        axes.set_ylabel(axis)
        axes.grid(axis="y", linewidth=0.4, alpha=0.5)
        kind = "medians" if center == "median" else "means with 95% t intervals"
        write_note(figure, f"Bars: {kind}. Points: one per participant.", synthetic)
        named = ", ".join(name for name, _ in levels)
        alt = f"{axis} of every participant in {counted(len(levels), 'level')}: {named}"
        return Picture("figure-levels", caption, alt, *in_both_formats(figure))


# The power curves of a simulation as one figure.

FORMATS = (".png", ".svg", ".pdf")


def draw_power(result: "PowerResult", target: float = 0.8) -> Figure:
    """Power against n, one line per effect, with two standard errors of the simulation either side."""
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


def save_power_figure(result: "PowerResult", path: Path, target: float = 0.8) -> None:
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
