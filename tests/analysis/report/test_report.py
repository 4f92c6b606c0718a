"""Tables, report, figures: readable at 80 columns, self-contained, marked, and the same bytes every time."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PolyCollection
from typer.testing import CliRunner

from analysis.cli import app
from analysis.paper.document import plain
from analysis.paper.statistics import check_text
from analysis.plans.clip_rating import READING, analyse_study
from analysis.plans.result import Analysis
from analysis.plans.sensitivity import bayes_factors, factor_text
from analysis.read.study_answers import StudyAnswers, load_csv
from analysis.report.figures import draw, figures_of
from analysis.report.formats import Table, as_markdown, as_text, wrap
from analysis.report.json_output import as_data
from analysis.report.latex import as_latex, latex_text
from analysis.report.numbers import apa_p, fixed, interval, p_value, share, sum_digits
from analysis.report.within_contents import contents_of, sentences
from analysis.report.within_tables import all_tables, corrected_df, paper_table
from analysis.report.write import self_check, write_report
from experiments.files import json_text
from experiments.load import load_experiment
from tests.analysis.cell_analysis import analyse_cells
from tests.analysis.ratings_file import rows_of, simulate, write_export


def analysis_of(name: str, folder, participants: int) -> Analysis:
    experiment = load_experiment(name)
    rows = rows_of(experiment, simulate(experiment, participants, trials=2))
    ratings: StudyAnswers = load_csv(
        write_export(folder / f"{name}.csv", experiment, rows), experiment, READING
    )
    return analyse_study(experiment, ratings)


@pytest.fixture(scope="module", params=["exp1", "exp2", "exp3"])
def analysis(request, tmp_path_factory) -> Analysis:
    return analysis_of(request.param, tmp_path_factory.mktemp("r"), 20)


def test_every_table_fits_80_columns(analysis) -> None:
    for table in all_tables(analysis):
        assert max(map(len, as_text(table).splitlines())) <= 80, table.key


def test_the_paper_table_has_conditions_tests_and_interactions(analysis) -> None:
    table = paper_table(analysis)
    factors = analysis.anova.factors
    levels = sum(map(len, analysis.anova.levels))
    assert len(table.rows) == levels + len(analysis.anova.effects) - len(factors)
    assert "SYNTHETIC" in table.title
    mean = analysis.means[0]
    assert table.rows[0][2] == f"{fixed(mean.mean)} ({fixed(mean.se)})"
    test = analysis.anova.effects[0]
    used = test.multivariate if all(e.multivariate for e in analysis.anova.effects) else test.univariate
    assert fixed(used.f_value) in table.rows[0]


def test_one_sentence_an_effect_with_its_numbers(analysis) -> None:
    said = sentences(analysis)
    assert len(said) == len(analysis.anova.effects)
    assert all(re.search(r"F\([\d.]+, [\d.]+\) = [\d.]+, p [=<] \.\d{3}", text) for text in said)


STATISTIC = re.compile(r"F\(([\d.]+), ([\d.]+)\) = ([\d.]+), p [=<] [^()]*?partial η² = (\.\d\d)")


def test_every_f_of_a_sentence_is_next_to_its_own_effect_size(analysis) -> None:
    found = [STATISTIC.findall(text) for text in sentences(analysis)]
    assert all(found)
    for df1, df2, f, eta in (match for matches in found for match in matches):
        size = float(f) * float(df1) / (float(f) * float(df1) + float(df2))
        assert float(eta) == pytest.approx(size, abs=0.0101), (f, df1, df2)


def test_the_report_finds_no_fault_with_its_own_sentences(analysis) -> None:
    said = self_check(sentences(analysis))
    read, checked, wrong = map(int, re.findall(r"\d+", said))
    assert read == checked >= len(analysis.anova.effects)
    assert wrong == 0, check_text(plain("\n\n".join(sentences(analysis))))
    assert "more cannot" not in said


def test_what_stood_alone_is_distinguished_from_what_was_recomputed() -> None:
    assert self_check(("r(20) = .50, p = .018.", "It is more (p = .001).")).endswith(
        "0 inconsistent; 1 more cannot be recomputed from the sentence."
    )
    assert self_check(("It is more (p = .001).",)).endswith("recomputed from the others.")


def test_json_has_the_promised_keys_and_no_nan(analysis) -> None:
    data = json.loads(json_text(as_data(analysis)), parse_constant=pytest.fail)
    effect = data["effects"][0]
    assert set(effect["univariate"]) == {
        *("ss", "ss_error", "df_effect", "df_error", "f_value", "p_value"),
        *("epsilon_gg", "p_gg", "epsilon_hf", "p_hf"),
        *("df_effect_gg", "df_error_gg", "df_effect_hf", "df_error_hf"),
    }
    assert set(effect["multivariate"]) == {
        *("pillai", "wilks", "hotelling_lawley", "roy", "f_value", "df_effect", "df_error", "p_value"),
        *("eta_sq_partial", "eta_sq_partial_ci", "exact", "statistics"),
    }
    assert {"mauchly", "eta_sq_partial", "eta_sq_partial_ci", "eta_sq_generalized"} <= set(effect)
    assert set(data["marginal_means"][0]) == {"effect", "levels", "mean", "se", "ci"}
    assert set(data["pairwise"][0]) == {
        *("effect", "level_a", "level_b", "cell_a", "cell_b", "difference", "se", "t", "df", "p"),
        *("p_bonferroni", "p_holm", "p_sidak", "p_tukey", "p_fdr", "ci", "dz", "dz_ci", "bayes_factor"),
    }
    assert data["n_participants"] == 20
    assert data["dropped"] == []


def test_report_is_whole_marked_self_contained_and_byte_stable(tmp_path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        write_report(contents_of(analysis_of("exp3", tmp_path, 6)), folder)
    names = sorted(path.name for path in one.iterdir())
    assert names == [
        *("cell-means.csv", "figure-lower-lid.png", "figure-lower-lid.svg", "report.docx"),
        *("report.html", "report.md", "report.tex", "results.json", "tables.tex", "verify.R"),
    ]
    assert all((one / name).read_bytes() == (two / name).read_bytes() for name in names)
    html = (one / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["'](?!data:|#)""", html)
    assert "Synthetic data" in html
    assert "SYNTHETIC" in (one / "report.md").read_text(encoding="utf-8")
    assert "SYNTHETIC" in (one / "tables.tex").read_text(encoding="utf-8")
    assert (one / "figure-lower-lid.png").read_bytes().startswith(b"\x89PNG")
    balanced(html)


class _Balance(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        if tag not in {"meta", "img", "br"}:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag


def balanced(html: str) -> None:
    parser = _Balance()
    parser.feed(html)
    assert parser.open == []


def test_names_are_escaped_everywhere(tmp_path) -> None:
    from analysis.within.cell_means import CellTable

    y = np.random.default_rng(0).normal(4, 1, (6, 2))
    cells = CellTable(tuple("abcdef"), ("f<b>",), (("<i>&", "x_y|%"),), y, np.ones((6, 2), dtype=np.int64))
    analysis = analyse_cells(cells, name="n", title="<script>", source="s", rating="r")
    write_report(contents_of(analysis), tmp_path)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script>" not in html
    assert "&lt;i&gt;&amp;" in html
    assert r"x\_y\textbar{}\%" in (tmp_path / "tables.tex").read_text(encoding="utf-8")
    assert "x_y\\|%" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_undefined_tests_are_dashes_with_a_reason(tmp_path) -> None:
    analysis = analysis_of("exp2", tmp_path, 5)
    text = " ".join(" ".join(as_text(table).split()) for table in all_tables(analysis))
    assert "needs more participants than contrasts: error df = 4" in text
    assert "univariate, df and p with the Greenhouse-Geisser correction" in text


def test_bayes_factors_are_next_to_the_planned_pairs(tmp_path) -> None:
    section = bayes_factors(analysis_of("exp3", tmp_path, 12))
    (table,) = section.tables
    assert len(table.rows) == 6
    assert all(row[0].startswith("Lower-lid motion: ") for row in table.rows)


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (p_value(0.0004), "<.001"),
        (p_value(0.0206), ".021"),
        (p_value(1.0), "1.000"),
        (p_value(float("nan")), "–"),
        (p_value(0.00061), "<.001"),
        (apa_p(0.00061), "p < .001"),
        (p_value(0.001), ".001"),
        (apa_p(0.0001), "p < .001"),
        (share(-0.25), "-.250"),
        (fixed(-0.001), "0.00"),
        (interval((1.234, float("nan"))), "[1.23, –]"),
        (sum_digits([1234.5, 0.2]), 2),
        (fixed(71.75499999999998), "71.76"),
        (fixed(-0.125), "-0.13"),
        (fixed(1e30, 1), f"{1e30:.1f}"),
        (sum_digits([0.01234]), 5),
    ],
)
def test_numbers_are_printed_as_apa_has_them(made, text) -> None:
    assert made == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0004, "<0.001"), (0.05, "0.050"), (3.456, "3.46"), (1.23e10, "1.2 × 10¹⁰"), (float("inf"), "–")],
)
def test_a_bayes_factor_may_exceed_one_and_so_keeps_its_zero(value: float, text: str) -> None:
    assert factor_text(value) == text


def test_every_pair_of_one_factor_has_a_bayes_factor(tmp_path) -> None:
    """Planned or not: exp2 plans no pairs of characters."""
    (table,) = bayes_factors(analysis_of("exp2", tmp_path, 24)).tables
    assert len(table.rows) == 10 + 6 + 1


def test_text_wraps_and_latex_escapes() -> None:
    assert max(map(len, wrap("word " * 60, 40))) <= 40
    assert latex_text("a_b & 5% < η²") == r"a\_b \& 5\% \ensuremath{<} \ensuremath{\eta}\ensuremath{^2}"
    table = Table("k", "Title", ("a", "b"), (("x" * 90, "1"),))
    assert max(map(len, as_text(table).splitlines())) <= 80
    assert "\\toprule" in as_latex(table)
    assert as_markdown(table).count("|") == 9


def test_data_are_plain(analysis) -> None:
    assert as_data(analysis)["exclusions"]["n_runs"] == 20


def test_the_note_under_a_figure_names_what_is_drawn(analysis: Analysis) -> None:
    """Figures of lines have no clouds."""
    for spec in figures_of(analysis):
        figure = draw(analysis, spec)[0]
        has_clouds = bool(figure.axes[0].findobj(PolyCollection))
        assert ("clouds" in figure.get_supxlabel()) is has_clouds
        assert has_clouds is (spec.style == "points")


@pytest.mark.parametrize("people", [5, 14])
def test_one_f_is_reported_first_everywhere(people: int) -> None:
    """Five people have no multivariate test of the interaction (6 contrasts): every F is univariate then."""
    from analysis.report.within_contents import effect_p
    from analysis.report.within_tables import paper_table, simple_effects_table
    from analysis.within.cell_means import cell_table
    from tests.analysis.cell_analysis import analyse_cells

    rng = np.random.default_rng(12)
    y = rng.normal(size=(people, 4, 3)) + 1.5 * np.arange(3) * np.arange(4)[:, None]
    rows = [(p, "wxyz"[a], "klm"[b], y[p, a, b]) for p, a, b in np.ndindex(y.shape)]
    cells = cell_table(pd.DataFrame(rows, columns=["p", "a", "b", "y"]), "p", "y", ["a", "b"])
    made = analyse_cells(cells, name="own", title="", source="", rating="y")
    several = people > 6
    assert ("multivariate" in paper_table(made).notes[0]) is several
    for effect in made.anova.effects:
        m, u = effect.multivariate, effect.univariate
        assert effect_p(made, effect) == (m.p_value if several else u.p_gg)
    assert made.simple_effects
    printed = simple_effects_table(made).rows
    for simple, row in zip(made.simple_effects, printed, strict=True):
        m, u = simple.test.multivariate, simple.test.univariate
        assert simple.p_value == (m.p_value if several else u.p_gg)
        q = u.df_effect
        assert row[2] == (f"{q}, {people - q}" if several else corrected_df(u))


def test_means_in_seconds_are_printed_with_the_decimals_that_tell_them_apart(tmp_path) -> None:
    """Of reaction times in seconds with an error of 4 ms two decimals would show 0.31 (0.00) throughout."""
    path = tmp_path / "seconds.csv"
    rows = [
        f"{i},{level},{0.3 + 0.012 * (i % 4) + 0.003 * k + 0.001 * ((i * (k + 2)) % 3)}"
        for i in range(12)
        for k, level in enumerate("abc")
    ]
    path.write_text("\n".join(["id,c,y", *rows]))
    call = ["anova", str(path), "--participant", "id", "--rating", "y", "--within", "c"]
    told = CliRunner().invoke(app, [*call, "--out", str(tmp_path / "seconds")])
    assert told.exit_code == 0, told.output
    means = {
        m["levels"]["c"]: m
        for m in json.loads((tmp_path / "seconds/results.json").read_text())["marginal_means"]
    }
    report = (tmp_path / "seconds/report.md").read_text(encoding="utf-8")
    for level, mean in means.items():
        assert f"| {level} | {mean['mean']:.4f} ({mean['se']:.4f}) |" in report
        assert f"{level} (M = {mean['mean']:.4f}, SE = {mean['se']:.4f})" in report


def test_equivalence_of_seconds_is_printed_with_the_decimals_of_its_pairs(tmp_path) -> None:
    """Bounds of half a hundredth printed as -0.01 and 0.01 would be others than those that were tested."""
    path = tmp_path / "seconds.csv"
    rows = [
        f"{i},{level},{0.3 + 0.012 * (i % 4) + 0.003 * k + 0.001 * ((i * (k + 2)) % 3)}"
        for i in range(12)
        for k, level in enumerate("abc")
    ]
    path.write_text("\n".join(["id,c,y", *rows]))
    call = ["anova", str(path), "--participant", "id", "--rating", "y", "--within", "c"]
    call += ["--equivalence", "0.005", "--out", str(tmp_path / "seconds")]
    printed = CliRunner().invoke(app, call)
    assert printed.exit_code == 0, printed.output
    (test, *_) = json.loads((tmp_path / "seconds/results.json").read_text())["equivalence"]
    low, high = test["ci"]
    report = (tmp_path / "seconds/report.md").read_text(encoding="utf-8")
    assert f"| c: a - b | {test['difference']:.5f} | [{low:.5f}, {high:.5f}] |" in report
    assert "(TOST) within [-0.005, 0.005]" in report
