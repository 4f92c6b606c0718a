"""Figures show names of factors and levels in any script as they are, or as numbers, never as boxes."""

import re
import warnings
from io import BytesIO

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib import font_manager
from matplotlib.backends.backend_svg import FigureCanvasSVG

from analysis.report import pictures
from analysis.report.figures import draw, figures_of
from analysis.report.pictures import STYLE, further_letters, in_both_formats, missing_characters, new_figure
from analysis.within.cell_means import cell_table
from tests.analysis.cell_analysis import analyse_cells

CHINESE = "眨眼"


def figure_of(first: tuple[str, str], second: tuple[str, str]):
    """A figure of two factors with levels of these names."""
    scores = np.random.default_rng(1).normal(4, 1, (6, 2, 2))
    rows = [
        {"person": f"p{p}", "score": scores[p, a, b], "$f$_x": first[a], "\\blur": second[b]}
        for p, a, b in np.ndindex(scores.shape)
    ]
    table = cell_table(pd.DataFrame(rows), "person", "score", ["$f$_x", "\\blur"])
    analysis = analyse_cells(table, name="odd", title="Odd", source="odd.csv", rating="score")
    return draw(analysis, figures_of(analysis)[0])[0]


@pytest.fixture
def no_further_fonts(monkeypatch) -> None:
    """A machine that has the fonts of matplotlib alone."""
    own = str(mpl.get_data_path())
    fonts = [font for font in font_manager.fontManager.ttflist if font.fname.startswith(own)]
    monkeypatch.setattr(font_manager.fontManager, "ttflist", fonts)


def test_a_dollar_and_a_backslash_are_letters() -> None:
    svg, png = in_both_formats(figure_of(("$\\frac$", "$x_1$"), ("100%", "a_b^c")))
    assert svg.endswith(b"</svg>\n")
    assert png.startswith(b"\x89PNG")


@pytest.mark.usefixtures("no_further_fonts")
def test_letters_without_a_font_are_distinguished_by_their_numbers() -> None:
    figure = figure_of((CHINESE, "مرحبا"), ("한", "b"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        svg, _ = in_both_formats(figure)
    with mpl.rc_context({**STYLE, "svg.fonttype": "none"}):
        shown = in_svg_text(figure)
    assert {"[U+7728][U+773C]", "مرحبا", "[U+D55C]", "b", "$f$_x", "\\blur"} <= shown
    assert any("are shown as their code points (U+...)." in line for line in shown)
    assert len(svg) > 10_000


def in_svg_text(figure) -> set[str]:
    made = BytesIO()
    with further_letters(figure):
        FigureCanvasSVG(figure).print_svg(made)
    return set(re.findall(r"<text[^>]*>([^<]*)</text>", made.getvalue().decode()))


def test_a_font_of_the_machine_draws_what_the_own_font_lacks(monkeypatch) -> None:
    figure = figure_of((CHINESE, "a"), ("c", "d"))
    names = {"DejaVu Sans", "DejaVu Sans Mono"}
    fonts = [font for font in font_manager.fontManager.ttflist if font.name in names]
    monkeypatch.setattr(font_manager.fontManager, "ttflist", fonts)
    own, name = pictures._charmap, "analysis.report.pictures._charmap"
    chinese = frozenset(map(ord, CHINESE))
    monkeypatch.setattr(name, lambda path: own(path) | (chinese if "Mono" in path else set()))
    with further_letters(figure):
        ticks = figure.axes[0].get_xticklabels()
        assert [label.get_text() for label in ticks] == ["a", CHINESE]
        assert ticks[0].get_fontfamily() == ["DejaVu Sans", "DejaVu Sans Mono"]
        assert "U+" not in figure.get_supxlabel()


def test_a_figure_of_known_letters_is_the_same_whatever_is_installed(no_further_fonts) -> None:
    assert missing_characters(["Größe", "глаз", "ηₚ²", "× – ≤\n"]) == set()
    figure = new_figure()
    figure.supxlabel("N = 3.")
    with further_letters(figure):
        assert figure.get_supxlabel() == "N = 3."
