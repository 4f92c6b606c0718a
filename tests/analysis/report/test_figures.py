"""Figures show the means of the tables, also with groups of unequal size and covariates."""

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.plans.clip_rating import analyse_study
from analysis.plans.plan import plan_of
from analysis.plans.result import Analysis, Labels
from analysis.read.long_csv import design_of, read_long_table
from analysis.read.pool import Pool
from analysis.read.study_answers import load_csv
from analysis.report import figures
from analysis.report.figures import draw, figures_of
from analysis.report.pictures import STYLE
from analysis.report.within_contents import draw_all
from analysis.within.cell_means import cell_table
from experiments.load import load_experiment
from tests.analysis.cell_analysis import analyse_cells
from tests.analysis.ratings_file import rows_of, simulate, write_export

EXP3 = load_experiment("exp3").model_copy(update={"exclusions": ()})
GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "between"


def analysed(name: str, within: list[str], between: list[str], covariates: list[str]) -> Analysis:
    data = read_long_table(GOLDEN / f"{name}.csv", "id", "y", within, between=between, covariates=covariates)
    cells = cell_table(data.rows, "id", "y", within)
    design = design_of(data.rows, "id", cells.participants, between, covariates)
    return analyse_cells(cells, name="own", title="", source="", rating="y", between=design)


DESIGNS = [
    (["phase"], ["treatment"], []),
    (["phase", "hour"], ["treatment", "gender"], ["age"]),
    (["phase"], [], ["age"]),
    (["phase"], ["gender"], ["age"]),
    ([], ["treatment"], ["age"]),
]


@pytest.mark.parametrize(("within", "between", "covariates"), DESIGNS)
def test_a_figure_has_the_means_and_intervals_of_the_table(within, between, covariates) -> None:
    analysis = analysed("obk", within, between, covariates)
    table = {frozenset(m.levels.items()): m for m in analysis.means}
    specs = figures_of(analysis)
    shown = {name for spec in specs for name in (*spec.along, spec.colour) if name}
    assert shown >= {*within[:1], *between[:1]}
    seen = 0
    for spec in specs:
        axes = draw(analysis, spec)[0].axes[0]
        labels = [text.get_text() for text in axes.get_xticklabels()]
        for container in axes.containers:
            line, _, (bars,) = container.lines
            for x, y, segment in zip(*line.get_data(), bars.get_segments(), strict=True):
                levels = {spec.along[0]: labels[round(x)]}
                if spec.colour:
                    levels[spec.colour] = container.get_label()
                wanted = table[frozenset(levels.items())]
                assert y == pytest.approx(wanted.mean)
                assert sorted(segment[:, 1]) == pytest.approx(wanted.ci)
                seen += 1
    assert seen >= 2 * len(specs)


def test_a_figure_shows_participants_in_their_own_group_alone() -> None:
    analysis = analysed("obk", ["phase"], ["treatment"], [])
    (spec,) = figures_of(analysis)
    axes = draw(analysis, spec)[0].axes[0]
    points = [line for line in axes.lines if line.get_marker() == "o" and line.get_markersize() == 2.6]
    drawn = sum(int(np.isfinite(np.asarray(line.get_ydata(), float)).sum()) for line in points)
    assert drawn == analysis.n_participants * 3


def test_the_caption_says_what_the_bars_are(tmp_path: Path) -> None:
    arguments = [
        "anova",
        str(GOLDEN / "obk.csv"),
        "--participant",
        "id",
        "--rating",
        "y",
        "--within",
        "phase",
    ]
    done = CliRunner().invoke(
        app, [*arguments, "--between", "treatment", "--covariate", "age", "--out", str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "estimated marginal means at the mean of age" in page
    assert "Cousineau" not in page


@pytest.mark.parametrize("extreme", [False, True])
def test_bars_beyond_the_scale_are_cut_and_the_caption_says_so(extreme: bool, tmp_path: Path) -> None:
    ratings = simulate(EXP3, 4)
    if extreme:  # One of four people differs by the whole scale: the interval ends above 7.
        ratings[:] = 7
        ratings[0, 0] = 1
    file = write_export(tmp_path / "r.csv", EXP3, rows_of(EXP3, ratings))
    analysis = analyse_study(EXP3, load_csv(file, EXP3, plan_of(EXP3.trial.kind).reading), Pool())
    [spec] = figures_of(analysis)
    figure, bars = draw(analysis, spec)
    low, high = figure.axes[0].get_ylim()
    assert (round(low, 1), round(high, 1)) == (0.8, 7.2)
    assert ("Bars are cut at the ends of the scale." in bars) == extreme


def test_the_conditions_of_a_figure_are_arranged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawing, note and alternative text are of the same conditions."""
    arranged: list[str] = []
    arrange = figures._arranged

    def noted(analysis: Analysis, spec: figures.FigureSpec) -> figures._Shown:
        arranged.append(spec.key)
        return arrange(analysis, spec)

    monkeypatch.setattr(figures, "_arranged", noted)
    analysis = analysed("obk", ["phase", "hour"], ["treatment"], [])
    pictures = draw_all(analysis)
    assert arranged == [picture.key for picture in pictures]
    assert all("estimated marginal means" in picture.alt for picture in pictures)


def assert_texts_are_whole(figure) -> None:
    """Every text that is drawn lies inside the picture, and no two texts of the legend or an axis overlap."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    frame = figure.bbox
    for text in figure.findobj(lambda one: hasattr(one, "get_text") and one.get_visible()):
        if not text.get_text().strip():
            continue
        box = text.get_window_extent(renderer)
        assert box.x0 >= frame.x0 - 1, text.get_text()
        assert box.x1 <= frame.x1 + 1, text.get_text()
        assert box.y0 >= frame.y0 - 1, text.get_text()
        assert box.y1 <= frame.y1 + 1, text.get_text()
    for axes in figure.axes:
        assert axes.get_window_extent(renderer).width > frame.width / 4
        legend = axes.get_legend()
        if legend is not None:
            assert not legend.get_window_extent(renderer).overlaps(
                axes.get_window_extent(renderer).shrunk(0.99, 1)
            )


def test_texts_of_a_figure_are_whole_whatever_their_length() -> None:
    analysis = analysed("obk", ["phase", "hour"], ["treatment", "gender"], ["age"])
    words = "a long name of a condition that somebody wrote"
    factors = {name: f"{words} ({name})" for name in analysis.anova.all_factors}
    levels = {
        (name, level): f"{level} {words}"
        for name, own in zip(analysis.anova.all_factors, analysis.anova.all_levels, strict=True)
        for level in own
    }
    named = replace(analysis, labels=Labels(factors, levels))
    for spec in figures_of(named):
        assert_texts_are_whole(draw(named, spec)[0])


@pytest.mark.parametrize("n_rules", [1, 6])
def test_labels_of_the_multiverse_figure_are_whole(n_rules: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from analysis.plans.multiverse import Multiverse, Universe
    from analysis.report import figures

    analysis = analysed("obk", ["phase", "hour"], [], [])
    effects = tuple(("a long factor name", f"another long factor {k}", "and a third one") for k in range(8))
    rules = tuple(
        f"exclude_participants_that_answered_too_{k}_quickly_in_most_trials" for k in range(n_rules)
    )
    universes = tuple(
        Universe(tuple(j >= k for j in range(n_rules)), 20 - k, 400 - k, (0.02,) * 8, (0.1,) * 8)
        for k in range(n_rules + 1)
    )
    drawn = []
    monkeypatch.setattr(figures, "in_both_formats", lambda figure: drawn.append(figure) or (b"", b""))
    figures.multiverse_picture(analysis, Multiverse(rules, effects, universes, 0))
    with mpl.rc_context(STYLE):
        assert_texts_are_whole(drawn[0])
