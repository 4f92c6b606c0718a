"""Statistics in running text: read, recomputed, and reported when they do not fit."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.paper.document import html_text, plain, read_document, tex_text
from analysis.paper.statistics import check_text
from experiments.errors import InputError


def only(text: str):
    (statistic,) = check_text(plain(text)).statistics
    return statistic


@pytest.mark.parametrize(
    "text",
    [
        "F(1, 30) = 4.56, p = .041, partial η² = .13",
        "F(2.21, 33.13) = 11.20, p < .001",
        "F(3, 29) = 0.50, p = .685",
        "t(28) = -2.10, p = .045",
        "χ²(2, N = 90) = 9.21, p = .010",
        "r(48) = .31, p = .028",
        "z = 2.33, p = .020",
        "F(1, 18) = 0.2, p > .05",
        "F(1, 18) = 0.00, p = .947, partial η² = .00, 95% CI [.00, .07]",
        "F(1, 18) = 0.00, p = 1.000",
        "t(18) = 0.00, p = .998",
        "F(1, 40) = 9.00, p = .005, generalised η² = .05",
        "F(1, 20) = 1,234.56, p < .001",
        "t(30) = 5.37, p = 8.2e-06",
        "t(30) = 5.37, p = 8.2 × 10⁻⁶",
        "t(30) = 5.37, p < 10^-4",
        "t(20) = 1.80, one-tailed p = .043",
        "t(20) = 1.80, p = .043 (one-sided)",
        "t(20) = 2.60, Holm-corrected p = .051",
        "t(20) = 2.60, p = .034, Bonferroni-adjusted",
        "In a 2 x 103 design t(20) = 2.60, p = .017",
    ],
)
def test_what_fits_is_consistent(text) -> None:
    assert only(text).verdict == "consistent", only(text).problems


@pytest.mark.parametrize(
    ("text", "verdict", "why"),
    [
        ("F(1, 30) = 4.56, p = .41", "decision", "gives p = .0"),
        ("F(1, 30) = 4.56, p = .030", "inconsistent", "gives p = .041"),
        ("t(28) = 1.20, p < .05", "decision", "the statistic gives"),
        ("F(12, 31) = 4.21, p < .001, partial η² = .12", "inconsistent", "partial η² of .62"),
        ("F(1, 30) = 4.56, p = .041, η² = .40", "inconsistent", "partial η² of .13"),
        (
            "F(1, 30) = 4.56, p = .041, partial η² = .13, 95% CI [.20, .40]",
            "inconsistent",
            "does not include",
        ),
        ("F(1, 30) = 4.56, p = .041, partial η² = .13, 95% CI [.10, .14]", "inconsistent", "noncentral F"),
        ("F(1, 18) = 0.00, p = .90", "inconsistent", "gives p = .9"),
        ("r(48) = .31, p = 1.2", "inconsistent", "not a probability"),
        ("F(1, 20) = 1,234.56, p = .33", "decision", "gives p = 1.9e-19"),
        ("t(30) = 5.37, p = 8.2e-05", "inconsistent", "gives p = 8.1e-06 to 8.3e-06"),
        ("t(20) = 1.80, one-tailed p = .087", "decision", "gives p = .04"),
        ("t(20) = 2.60, p = .001, Bonferroni-corrected", "inconsistent", "gives p = .017 to 1.000"),
    ],
)
def test_what_does_not_fit_is_reported(text, verdict, why) -> None:
    statistic = only(text)
    assert statistic.verdict == verdict
    assert why in statistic.problems[0]


def test_each_statistic_has_its_own_p_and_what_is_unread_is_said() -> None:
    result = check_text(
        "F(1, 30) = 4.56, and t(28) = 2.10, p = .045. Also F (see Table 2), F(3) = 2 and p = .03."
    )
    assert [s.verdict for s in result.statistics] == ["unchecked", "consistent"]
    assert [fragment[:5] for fragment in result.unread] == ["F(3) ", "p = ."]


@pytest.mark.parametrize("text", ["F(1; 20) = 4,35; p = 0,003", "t(19) = 2,10; p = 0,049", "z = 2,33"])
def test_numbers_with_a_decimal_comma_are_reported_as_unread(text) -> None:
    result = check_text(plain(text))
    assert result.statistics == ()
    assert bool(result.unread) == ("p = " in text)


def test_html_and_tex_are_read_as_their_readers_see_them() -> None:
    html = "<p><em>F</em>(1,&nbsp;30) = 4.56, <i>p</i> = .041, η<sub>p</sub><sup>2</sup> = .13</p>"
    html += "<script>F(1, 2) = 3</script>"
    tex = r"$F(1, 30) = 4.56$, $p = .041$, $\eta_p^2 = .13$ % F(1, 30) = 9, p = .5"
    for text in (html_text(html), tex_text(tex)):
        statistic = only(text)
        assert (statistic.effect_size, statistic.verdict) == (".13", "consistent")


def test_docx_and_pdf(tmp_path) -> None:
    docx = pytest.importorskip("docx", reason="python-docx is not installed")
    document = docx.Document()
    document.add_paragraph("F(1, 30) = 4.56, p = .41")
    document.save(tmp_path / "m.docx")
    result = CliRunner().invoke(app, ["check-paper", str(tmp_path / "m.docx")])
    assert "1 statistics read, 1 checked, 1 inconsistent, 0 could not be read" in result.output
    assert result.exit_code == 1
    (tmp_path / "broken.docx").write_bytes(b"no zip")
    with pytest.raises(InputError, match="not a readable DOCX"):
        read_document(tmp_path / "broken.docx")


def test_a_pdf_is_read_by_its_text_layer(tmp_path) -> None:
    pytest.importorskip("pypdf", reason="pypdf is not installed")
    from matplotlib.figure import Figure

    figure = Figure()
    figure.text(0.1, 0.5, "F(1, 30) = 4.56, p = .041")
    figure.savefig(tmp_path / "m.pdf")
    assert only(read_document(tmp_path / "m.pdf")).verdict == "consistent"
    Figure().savefig(tmp_path / "empty.pdf")
    with pytest.raises(InputError, match="no text layer"):
        read_document(tmp_path / "empty.pdf")


@pytest.mark.parametrize(("name", "message"), [("absent.txt", "no file"), ("m.xyz", "cannot read '.xyz'")])
def test_other_files_are_refused(tmp_path, name, message) -> None:
    (tmp_path / "m.xyz").write_text("x")
    with pytest.raises(InputError, match=message):
        read_document(tmp_path / name)


def test_text_without_statistics_has_none(tmp_path) -> None:
    file = tmp_path / "words.txt"
    file.write_text("nothing to read here")
    result = CliRunner().invoke(app, ["check-paper", str(file)])
    assert result.exit_code == 0
    assert "0 statistics read" in result.output


@pytest.mark.parametrize(
    "text",
    [
        "The effect was large, F(1, 20) = 9.00; age did not matter, p = .40.",
        "There was an effect, t(20) = 3.1, whereas the interaction was not significant (p = .60).",
        "It rose, t(30) = 2.1. In a second test p = .5 was seen.",
        "F(1, 20) = 9.00, MSE = 0.3; the group × time interaction, p = .30, was not",
        "F(1, 20) = 9.00, the other factor being without any, p = .30",
        "F(1, 20) = 9.00; generalised η² = .02, partial η² of the interaction with age, p = .30",
    ],
)
def test_a_p_of_the_next_clause_is_not_that_of_the_statistic_before(text) -> None:
    check = check_text(plain(text))
    assert check.statistics[0].p is None, check.statistics
    assert check.n_wrong == 0
    assert any("p = ." in one for one in check.unread)


@pytest.mark.parametrize(
    "text",
    [
        "F(1, 20) = 9.00, MSE = 2.3, p = .007",
        "F(1, 20) = 9.00; partial eta squared = .31; p = .007",
        "F(1, 20) = 9.00, Greenhouse-Geisser corrected p = .007",
        "F(1, 20) = 9.00, with an effect size of η² = .31, p = .007",
        "F1(1, 20) = 9.00, p = .007",
        "t(18) = -2.45, d = 0.55, 95% CI [0.1, 1.0], BF10 = 2.5, p = .025",
        "t(18) = -2.45, which was significant, p = .025",
        "F(1, 20) = 9.00 (p = .007)",
    ],
)
def test_a_p_behind_sizes_and_words_of_reports_is_its_own(text) -> None:
    assert only(text).verdict == "consistent"


@pytest.mark.parametrize(
    ("tex", "read"),
    [
        ("$F_{1,20}=9.00$, $p=.007$", "F(1,20)=9.00, p=.007"),
        ("$t_{28} = 2.10$, $p = .045$", "t(28) = 2.10, p = .045"),
        (r"$\chi^2_2 = 9.21$, $p = .010$", "χ2(2) = 9.21, p = .010"),
        (r"$F\left(1,20\right)=9.00, p=.007$", "F(1,20)=9.00, p=.007"),
    ],
)
def test_degrees_of_freedom_below_the_line_are_read(tex, read) -> None:
    statistic = only(tex_text(tex))
    assert (statistic.text, statistic.verdict) == (read, "consistent")


def test_a_word_file_is_read_as_its_reader_sees_it(tmp_path) -> None:
    """Insertions, formulas, Word's symbols and merged cells once; nothing that was deleted."""
    from docx import Document
    from docx.oxml import parse_xml
    from docx.oxml.ns import nsdecls

    namespaces = nsdecls("w") + ' xmlns:m="http://schemas.openxmlformats.org/officeDocument/2006/math"'
    document = Document()
    for part in (
        f'<w:ins {namespaces} w:id="1" w:author="x"><w:r><w:t>t(30) = 2.10, p = .044</w:t></w:r></w:ins>',
        f'<w:del {namespaces} w:id="2" w:author="x"><w:r><w:delText>t(31) = 2</w:delText></w:r></w:del>',
        f"<m:oMath {namespaces}><m:r><m:t>F(1, 33)=9.1, p=.005</m:t></m:r></m:oMath>",
        f'<w:r {namespaces}><w:sym w:font="Symbol" w:char="F063"/><w:t>2(2) = 7.5, p = .024</w:t></w:r>',
    ):
        document.add_paragraph("").add_run("")
        document.paragraphs[-1]._p.append(parse_xml(part))
    table = document.add_table(2, 3)
    table.cell(0, 0).merge(table.cell(0, 2)).text = "F(2, 40) = 3.0, p = .061"
    document.save(tmp_path / "a.docx")
    check = check_text(read_document(tmp_path / "a.docx"))
    assert [one.text for one in check.statistics] == [
        "t(30) = 2.10, p = .044",
        "F(1, 33)=9.1, p=.005",
        "χ2(2) = 7.5, p = .024",
        "F(2, 40) = 3.0, p = .061",
    ]
    assert {one.verdict for one in check.statistics} == {"consistent"}
    assert check.unread == ()


def test_a_damaged_word_file_ends_in_one_line(tmp_path) -> None:
    from docx import Document

    path = tmp_path / "a.docx"
    Document().save(path)
    whole = path.read_bytes()
    rng = np.random.default_rng(2)
    said = set()
    for _ in range(30):
        damaged = bytearray(whole)
        for at in rng.integers(len(whole), size=20):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_document(path)
        except InputError as error:
            said.add(str(error))
    assert len(said) > 1
    assert all("a.docx is not a readable DOCX file: " in one and "\n" not in one for one in said)


@pytest.mark.parametrize("text", ["p\np < .05\npartial η²", "* p < .05, ** p < .01", "†p < .001"])
def test_a_level_over_a_column_or_in_a_legend_is_not_a_statistic(text) -> None:
    assert check_text(plain(text)).unread == ()


def test_a_level_in_a_sentence_is_reported_as_unread() -> None:
    assert check_text("All of them differed, p < .05.").unread == ("p < .05.",)


def test_notes_of_a_word_file_are_read(tmp_path) -> None:
    from docx import Document
    from docx.opc.constants import RELATIONSHIP_TYPE
    from docx.opc.packuri import PackURI
    from docx.opc.part import Part
    from docx.oxml.ns import nsdecls

    document = Document()
    document.add_paragraph("t(30) = 2.10, p = .044")
    for kind, said in (("footnote", "F(1, 30) = 4.56, p = .41"), ("endnote", "z = 1.96, p = .050")):
        text = (
            f'<w:{kind}s {nsdecls("w")}><w:{kind} w:type="separator" w:id="-1"><w:p><w:r>'
            f'<w:separator/></w:r></w:p></w:{kind}><w:{kind} w:id="1"><w:p><w:r><w:{kind}Ref/></w:r>'
            f"<w:r><w:t>{said[:9]}</w:t></w:r><w:r><w:t>{said[9:]}</w:t></w:r>"
            f"</w:p></w:{kind}></w:{kind}s>"
        )
        content = f"application/vnd.openxmlformats-officedocument.wordprocessingml.{kind}s+xml"
        part = Part(PackURI(f"/word/{kind}s.xml"), content, text.encode(), document.part.package)
        document.part.relate_to(part, getattr(RELATIONSHIP_TYPE, f"{kind.upper()}S"))
    document.save(tmp_path / "a.docx")
    check = check_text(read_document(tmp_path / "a.docx"))
    assert {one.text: one.verdict for one in check.statistics} == {
        "t(30) = 2.10, p = .044": "consistent",
        "F(1, 30) = 4.56, p = .41": "decision",
        "z = 1.96, p = .050": "consistent",
    }


@pytest.mark.parametrize("suffix", [".txt", ".tex", ".md"])
@pytest.mark.parametrize(
    "at",
    [
        "F(1,|31)",
        "31)|= 9.93",
        "=|9.93,",
        "9.93,|p",
        "p|= .004",
        "partial|η2",
        "95%|CI",
        "CI|[.03",
        "[.03,|.45",
    ],
)
def test_a_line_may_end_within_a_statistic(tmp_path: Path, suffix: str, at: str) -> None:
    """LaTeX breaks lines anywhere: of 20 statistics of a report in PDF 5 could not be read."""
    said = "It was so, F(1, 31) = 9.93, p = .004, partial η2 = .24, 95% CI [.03, .45]."
    broken = said.replace(at.replace("|", " "), at.replace("|", "\n"))
    assert broken != said
    path = tmp_path / f"paper{suffix}"
    path.write_text(broken.replace("%", "\\%") if suffix == ".tex" else broken, encoding="utf-8")
    checked = check_text(read_document(path))
    (one,) = checked.statistics
    assert (one.p, one.effect_size, one.verdict, checked.unread) == ("= .004", ".24", "consistent", ())


@pytest.mark.parametrize(
    "text",
    [
        "t(20) = 2.60, p = .051 (Bonferroni)",
        "t(20) = 2.60, p = .051 (Holm)",
        "t(20) = 2.60, p = .051, Tukey HSD",
        "t(20) = 2.60, Tukey-corrected p = .043",
        "t(20) = 2.60, p = .043, Tukey-corrected",
        "t(20) = 2.60, Holm-Bonferroni-adjusted p = .051",
        "t(20) = 2.60, p_Tukey = .043",
        "t(20) = 2.60, padj = .051",
        "After Bonferroni correction, A differed from B, t(20) = 2.60, p = .051.",
        "F(2, 40) = 3.40, p = .051 (Greenhouse-Geisser)",
        "t(20) = 1.80, p = .043, one-sided test",
        "t(20) = 1.80, p = .043 (1-tailed)",
        "t(20) = 1.80, one sided p = .043",
        "A one-sided t test showed a difference, t(20) = 1.80, p = .043.",
        "All tests were one-tailed. A differed from B, t(20) = 1.80, p = .043.",
        "F(1, 20) = 3.24, p = .043, one-sided",
        "t(20) = -1.80, p = .957, one-sided",
    ],
)
def test_corrected_and_one_sided_tests_are_not_errors(text: str) -> None:
    (found,) = check_text(text).statistics
    assert found.verdict == "consistent", found.problems


@pytest.mark.parametrize(
    "text",
    [
        "t(20) = 2.60, p = .001 (Bonferroni)",
        "t(20) = 2.60, uncorrected p = .051",
        "t(20) = 1.80, p = .020, one-sided",
        "We used Bonferroni correction for pairs. A differed from B, t(20) = 2.60, p = .051.",
        "A one-sided t test showed a difference. B did not, t(20) = 1.80, p = .043.",
    ],
)
def test_words_about_something_else_excuse_no_error(text: str) -> None:
    (found,) = check_text(text).statistics
    assert found.verdict in ("inconsistent", "decision")
