"""The report as a LaTeX document: well formed for any data, and typeset where TeX is installed."""

import re
import shutil
import subprocess
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.plans.clip_rating import READING, analyse_study
from analysis.read.study_answers import load_csv
from analysis.report.contents import Contents, Part, Picture, Section
from analysis.report.formats import Table
from analysis.report.latex import LONG, as_latex, latex_text
from analysis.report.within_contents import contents_of
from analysis.report.write import write_report
from analysis.within.cell_means import cell_table
from experiments.load import load_experiment
from tests.analysis.cell_analysis import analyse_cells
from tests.analysis.ratings_file import rows_of, simulate, write_export


def has_tex() -> bool:
    """Whether pdflatex is here with the packages that a report loads."""
    if shutil.which("pdflatex") is None or shutil.which("kpsewhich") is None:
        return False
    call = ["kpsewhich", "caption.sty", "booktabs.sty"]
    asked = subprocess.run(call, capture_output=True, text=True, check=False)
    return len(asked.stdout.split()) == 2


needs_tex = pytest.mark.skipif(not has_tex(), reason="no pdflatex with packages (texlive-latex-recommended)")

LETTERS = "".join(map(chr, range(0xA1, 0x180)))
ODD = (
    "[0.1] \\\\ 5% & $x_1^2$ {a}~#",
    "q\"uo`te's * |x| <b>\n\t",
    "an empty\n\n \nline\r\n\r\nor two",
    "眼睛 глаз 𝒳 😀 a\u0301 \x00\x1b",
    "η² ≤ -0.5 – χ²ₚ",
)
DOT = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a49444154789c6360000000020001"
    "48afa4710000000049454e44ae426082"
)


def odd_contents() -> Contents:
    """What no table or sentence should be able to break."""
    header = ("[head]", "*", "n")
    rows = tuple((text, text, "-1.25") for text in (*ODD, LETTERS[:120], LETTERS[120:]))
    short = Table("first", ODD[0], header, rows, 2, ODD)
    long = Table("long", ODD[1], header, rows * (LONG // len(rows) + 1), 2, ODD)
    picture = Picture("figure-x", ODD[0], "alt", b"<svg/>", DOT)
    section = Section("[Section] #1", " ".join(ODD), (Table("more", "t", ("a",), ()),))
    part = Part(
        (short, long),
        ("F(1, 18) = 4.50, p = .048 & more.", *ODD),
        "A_part",
        lambda: (picture,),
        lambda _: (section,),
        brief=ODD,
    )
    return Contents("n", ODD[0], "lead", "a_b%.csv", True, 3, ODD, (), (part,), "".join(ODD), {})


def document(contents: Contents, folder: Path) -> str:
    write_report(contents, folder, more=True)
    return (folder / "report.tex").read_text(encoding="utf-8")


def well_formed(text: str, folder: Path) -> None:
    """Braces and environments close, rows have their columns, references and pictures are there."""
    bare = re.sub(r"\\[\\{}&%$#_]", "", text)
    assert bare.count("{") == bare.count("}")
    open_ones: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+)\}", text):
        if kind == "begin":
            open_ones.append(name)
        else:
            assert open_ones.pop() == name
    assert open_ones == []
    labels = re.findall(r"\\label\{([^}]*)\}", text)
    assert len(labels) == len(set(labels))
    assert set(re.findall(r"\\ref\{([^}]*)\}", text)) <= set(labels)
    assert all(
        (folder / name).is_file() for name in re.findall(r"\\includegraphics\[[^]]*\]\{([^}]*)\}", text)
    )
    for body in re.findall(r"\\toprule\n(.*?)\\bottomrule", text, re.DOTALL):
        rows = [line for line in body.replace(r"\&", "").split(r"\\" + "\n") if "&" in line]
        assert len({row.count("&") for row in rows}) <= 1


def compiled(folder: Path) -> str:
    """What pdflatex says, without fonts and without output, which only take time."""
    call = ["pdflatex", "-draftmode", "-interaction=nonstopmode", "-halt-on-error", "report.tex"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    assert done.returncode == 0, done.stdout[-3000:]
    return (folder / "report.log").read_text(encoding="utf-8", errors="replace")


@pytest.fixture(scope="module")
def report_folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("latex")
    experiment = load_experiment("exp1")
    file = write_export(folder / "r.csv", experiment, rows_of(experiment, simulate(experiment, 20)))
    write_report(contents_of(analyse_study(experiment, load_csv(file, experiment, READING))), folder)
    return folder


def test_a_report_is_a_whole_document_with_captions_labels_and_figures(report_folder) -> None:
    text = (report_folder / "report.tex").read_text(encoding="utf-8")
    well_formed(text, report_folder)
    assert text.count(r"\caption{") >= 8
    assert text.count("{[}SYNTHETIC DATA]") >= 7
    assert r"\ref{fig:figure-9}" in text
    assert r"\includegraphics[width=.95\linewidth]{figure-9.png}" in text
    assert r"\begin{longtable}" in text
    assert re.search(r"\\textit\{F\}\(\d+,~\d+\)~=~", text)


def test_captions_are_above_and_notes_below(report_folder) -> None:
    text = (report_folder / "report.tex").read_text(encoding="utf-8")
    for body in re.findall(r"\\begin\{figure\}(.*?)\\end\{figure\}", text, re.DOTALL):
        assert body.index(r"\caption{") < body.index(r"\includegraphics") < body.index(r"\textit{Note.}")
    first = re.findall(r"\\begin\{table\}.*?\\end\{table\}", text, re.DOTALL)[0]
    assert first.index(r"\caption{") < first.index(r"\toprule") < first.index(r"\textit{Note.} \textit{N}")
    assert "|" not in "".join(re.findall(r"\\begin\{(?:tabular|longtable)\}\{(.*)\}\n", text))
    assert "labelsep=newline" in text


def test_every_table_and_figure_is_mentioned(report_folder) -> None:
    text = (report_folder / "report.tex").read_text(encoding="utf-8")
    keys = re.findall(r"\\label\{([^}]*)\}", text)
    said = re.sub(
        r"\\ref\{tab:([^}]*)\} to \\ref\{tab:([^}]*)\}",
        lambda two: " ".join(
            rf"\ref{{{key}}}" for key in keys[keys.index(f"tab:{two[1]}") : keys.index(f"tab:{two[2]}") + 1]
        ),
        text,
    )
    assert set(re.findall(r"\\ref\{([^}]*)\}", said)) == set(keys)


def test_an_indented_row_and_a_difference_are_set_as_such() -> None:
    made = as_latex(Table("k", "t", ("a", "b"), (("  slow-in - fast", "r = -.3"),)))
    assert r"~~slow-in \ensuremath{-} fast & \textit{r} = \ensuremath{-}.3 \\" in made
    assert latex_text("ηₚ²") == r"\ensuremath{\eta}\ensuremath{_p^2}"


@needs_tex
def test_tex_sets_a_report(report_folder) -> None:
    assert "Undefined control sequence" not in compiled(report_folder)
    log = compiled(report_folder)
    assert "Overfull" not in log
    assert "undefined" not in log


def test_no_character_breaks_the_document(tmp_path) -> None:
    well_formed(document(odd_contents(), tmp_path), tmp_path)


def odd_factors() -> Contents:
    """A table of ratings whose factors' names are what people write in headers."""
    names = ("Speed (m/s)", "Speed {m s}", "50%_#\\", "Größe")
    cells = list(product("ab", repeat=len(names)))
    cells = list(product("ab", repeat=len(names)))
    scores = np.random.default_rng(1).normal(4, 1, (6, len(cells)))
    rows = [
        {"person": f"p{number}", "score": float(score), **dict(zip(names, cell, strict=True))}
        for number, person in enumerate(scores)
        for cell, score in zip(cells, person, strict=True)
    ]
    table = cell_table(pd.DataFrame(rows), "person", "score", list(names))
    return contents_of(analyse_cells(table, name="odd", title="Odd", source="odd.csv", rating="score"))


def test_odd_names_of_factors_name_files_and_labels_alike(tmp_path) -> None:
    text = document(odd_factors(), tmp_path / "report")
    well_formed(text, tmp_path / "report")
    keys = re.findall(r"\\label\{fig:([^}]*)\}", text)
    assert len(keys) == len(set(keys)) == 6
    assert keys[0] == "figure-Speed-m-s-Speed-m-s"
    assert all(re.fullmatch(r"[\w-]+", key, re.ASCII) for key in keys)


@needs_tex
def test_tex_sets_odd_names_of_factors(tmp_path) -> None:
    document(odd_factors(), tmp_path / "report")
    compiled(tmp_path / "report")


@needs_tex
def test_tex_sets_every_letter_and_sign(tmp_path) -> None:
    document(odd_contents(), tmp_path)
    compiled(tmp_path)


@pytest.mark.skipif(shutil.which("luatex") is None, reason="no luatex (texlive-binaries)")
def test_a_letter_that_the_font_of_luatex_lacks_is_shown_as_its_number(tmp_path) -> None:
    """XeTeX and LuaTeX leave such a letter out, so that two levels would have one name."""
    text = document(odd_contents(), tmp_path)
    declared = re.findall(r"^\\catcode.*\\fi\}$", text, re.MULTILINE)
    assert any("773C" in line for line in declared)
    plain = "\n".join([*declared, r"\def\texttt#1{#1}\message{<眼>}", r"\setbox0\hbox{眼睛}\bye"])
    (tmp_path / "plain.tex").write_text(r"\catcode`\@=11 " + plain, encoding="utf-8")
    call = ["luatex", "-draftmode", "-interaction=nonstopmode", "plain.tex"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, errors="replace", check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Missing character" not in (tmp_path / "plain.log").read_text(encoding="utf-8", errors="replace")


@given(st.text(max_size=40))
@settings(max_examples=100, deadline=None)
def test_nothing_in_a_text_is_a_command(text) -> None:
    made = latex_text(text)
    plain = re.sub(r"\\ensuremath\{[^}]*\}|\\text\w+\{\}|\\dots\{\}|\{\[\}|\{\*\}|\\[&%$#_{}]", "", made)
    assert not set(plain) & set("\\&%$#_{}^[*")


def test_a_negative_number_has_a_minus_sign_and_a_range_none() -> None:
    table = Table("k", "t", ("id", "n"), (("-7", "-0.5, 1-7"), ("-7", "id -7")), 1, ("-0.5, 1-7, a-1",))
    made = as_latex(table)
    assert "\n-7 & \\ensuremath{-}0.5, 1-7 \\\\\n-7 & id -7 \\\\\n" in made, "ids keep their hyphens"
    assert r"\ensuremath{-}0.5, 1-7, a-1" in made
    assert latex_text("$<") == r"\$\ensuremath{<}"


def test_a_long_table_breaks_and_a_wide_one_shrinks() -> None:
    rows = tuple((str(i), "1") for i in range(LONG + 1))
    assert r"\endhead" in as_latex(Table("k", "T", ("a", "b"), rows))
    assert r"\resizebox" in as_latex(Table("k", "T", ("a", "b"), rows[:3]))
