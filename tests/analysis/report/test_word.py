"""The Word file says what the page says, and the same data give the same bytes."""

import shutil
import subprocess
from io import BytesIO
from zipfile import ZipFile

import docx
import pytest
from docx.oxml.ns import qn

from analysis.plans.clip_rating import PLAN, READING, contents
from analysis.plans.plan import prepare
from analysis.read.study_answers import load_csv
from analysis.report.formats import Table, widths_cm
from analysis.report.numbers import note_pieces, pieces, unbroken
from analysis.report.write import write_report
from experiments.load import load_experiment
from table_files import counted
from tests.analysis.ratings_file import rows_of, simulate, write_export

EXP3 = load_experiment("exp3")


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The folder of a report on eight people."""
    folder = tmp_path_factory.mktemp("report")
    export = write_export(folder / "r.csv", EXP3, rows_of(EXP3, simulate(EXP3, 8, trials=3)))
    said = contents(prepare(EXP3, PLAN, load_csv(export, EXP3, READING)))
    write_report(said, folder / "out", more=True)
    return said, folder / "out"


def test_word_finds_title_mark_brief_tables_and_figures(report) -> None:
    said, folder = report
    document = docx.Document(str(folder / "report.docx"))
    text = [paragraph.text.replace("\u00a0", " ") for paragraph in document.paragraphs]
    assert text[0] == said.title
    assert any(line.startswith("SYNTHETIC DATA") for line in text)
    assert "In brief" in text
    for sentence in said.parts[0].sentences:
        assert sentence in text
    tables = said.parts[0].tables
    assert len(document.tables) > len(tables)
    first = [[cell.text for cell in row.cells] for row in document.tables[0].rows]
    assert first == [list(row) for row in (tables[0].header, *tables[0].rows)]
    assert len(document.inline_shapes) == 2  # the figure of the lower lid, and the multiverse


def test_symbols_are_in_italics(report) -> None:
    document = docx.Document(str(report[1] / "report.docx"))
    italic = {run.text for paragraph in document.paragraphs for run in paragraph.runs if run.italic}
    assert {"F", "p", "M", "SE"} <= italic
    assert "<i>p</i> " in (report[1] / "report.html").read_text(encoding="utf-8")


def test_tables_fit_the_page_and_keep_their_heads(report) -> None:
    document = docx.Document(str(report[1] / "report.docx"))
    section = document.sections[0]
    room = section.page_width - section.left_margin - section.right_margin
    for table in document.tables:
        widths = [column.width for column in table.columns]
        assert all(width is not None for width in widths)
        assert sum(widths) <= room + 10_000, "a tenth of a millimetre may come of rounding"
        assert [cell.width for cell in table.rows[1].cells] == widths
        assert table.rows[0]._tr.xpath("./w:trPr/w:tblHeader"), "the head is on every page"
        assert all(row._tr.xpath("./w:trPr/w:cantSplit") for row in table.rows)
    widest = max(document.tables, key=lambda table: len(table.rows))
    assert widest.columns[0].width > 2 * widest.columns[1].width, "texts are wider than numbers"


@pytest.mark.parametrize(("room", "sums"), [(16.0, True), (3.0, False)])
def test_columns_of_numbers_are_whole_and_texts_give_way(room, sums) -> None:
    row = (
        "a label of many words that is longer than any line of a page can be, and longer, and longer still",
        "-1.25",
    )
    widths = widths_cm(Table("k", "t", ("Effect", "F"), (row,) * 3), room)
    assert widths[1] == widths_cm(Table("k", "t", ("Effect", "F"), (("a", row[1]),)), 16.0)[1]
    assert (abs(sum(widths) - room) < 1e-9) is sums
    assert widths[0] >= 2.4
    capitals = widths_cm(Table("k", "t", ("", "DMOS"), (("a", "1"),)), room)[1]
    assert capitals > widths_cm(Table("k", "t", ("", "dmos"), (("a", "1"),)), room)[1]


def test_no_clock_is_in_the_file(report) -> None:
    with ZipFile(BytesIO((report[1] / "report.docx").read_bytes())) as file:
        assert {entry.date_time[0] for entry in file.infolist()} == {1980}


@pytest.mark.parametrize(
    ("text", "symbols"),
    [
        ("F(2, 18) = 4.50, p = .048, M = 3.1, SE = 0.2", ["F", "p", "M", "SE"]),
        ("Factor F and point p differ; SEM = 2", []),
        ("t(28) = −2.10, p < .001", ["t", "p"]),
    ],
)
def test_only_symbols_before_a_number_are(text, symbols) -> None:
    assert [piece for piece, is_symbol in pieces(text) if is_symbol] == symbols
    assert "".join(piece for piece, _ in pieces(text)) == text


def fields(paragraph) -> list[str]:
    return [text.text for text in paragraph._p.iter(qn("w:instrText"))]


def test_captions_are_numbered_by_word_and_each_figure_and_table_has_alternative_text(report) -> None:
    _, folder = report
    document = docx.Document(str(folder / "report.docx"))
    captions = [paragraph for paragraph in document.paragraphs if paragraph.style.name == "Caption"]
    for label, count in (("Table", len(document.tables)), ("Figure", len(document.inline_shapes))):
        own = [paragraph for paragraph in captions if paragraph.text.startswith(f"{label} ")]
        assert len(own) == count > 0
        for number, paragraph in enumerate(own, start=1):
            numbered, title = paragraph.text.split("\n")
            assert numbered == f"{label} {number}"
            assert {run.text for run in paragraph.runs if run.bold and run.text} == {f"{label} ", str(number)}
            assert [run.text for run in paragraph.runs if run.italic] == [title]
            (mark,) = paragraph._p.iter(qn("w:bookmarkStart"))
            assert mark.get(qn("w:name")) == f"{label}{number}"
            assert fields(paragraph) == [f" SEQ {label} \\* ARABIC "]
            kinds = [mark.get(qn("w:fldCharType")) for mark in paragraph._p.iter(qn("w:fldChar"))]
            assert kinds == ["begin", "separate", "end"]
    assert len(captions) == len(document.tables) + len(document.inline_shapes)
    for shape in document.inline_shapes:
        properties = shape._inline.docPr
        assert len(properties.get("descr")) > 30
        assert properties.get("title")
    for table in document.tables:
        (caption,) = table._tbl.tblPr.iter(qn("w:tblCaption"))
        (said,) = table._tbl.tblPr.iter(qn("w:tblDescription"))
        assert caption.get(qn("w:val"))
        assert said.get(qn("w:val")).startswith(f"{counted(len(table.rows) - 1, 'row')}; columns: ")


def test_notes_begin_as_such_and_are_under_what_they_are_of(report) -> None:
    said, folder = report
    document = docx.Document(str(folder / "report.docx"))
    notes = [paragraph for paragraph in document.paragraphs if paragraph.style.name == "Body Text 3"]
    assert notes
    for note in notes:
        assert note.text.startswith("Note. ")
        assert note.runs[0].italic
        before = note._p.getprevious()
        assert before.tag == qn("w:tbl") or list(before.iter(qn("w:drawing")))
    first = said.parts[0].tables[0]
    assert any(first.notes[0][:30] in note.text.replace("\u00a0", " ") for note in notes)


def test_every_table_and_figure_is_mentioned_in_the_text(report) -> None:
    """By a field that follows the number of the caption."""
    document = docx.Document(str(report[1] / "report.docx"))
    every = {f"Table{number + 1}" for number in range(len(document.tables))}
    every |= {f"Figure{number + 1}" for number in range(len(document.inline_shapes))}
    marks = [mark.get(qn("w:name")) for mark in document.element.body.iter(qn("w:bookmarkStart"))]
    assert set(marks) == every
    assert len(marks) == len(every)
    mentioned: set[str] = set()
    for paragraph in document.paragraphs:
        named = [text.split()[1] for text in fields(paragraph) if text.startswith(" REF ")]
        if " to " in paragraph.text and len(named) > 1 and named[0].startswith("Table"):
            first, last = (int(name.removeprefix("Table")) for name in named[:2])
            mentioned |= {f"Table{number}" for number in range(first, last + 1)}
        mentioned |= set(named)
    assert mentioned == every
    assert any(paragraph.text == "See Table\u00a01 and Figure\u00a01." for paragraph in document.paragraphs)


def test_tables_have_three_rules_and_no_vertical_ones(report) -> None:
    document = docx.Document(str(report[1] / "report.docx"))
    for table in document.tables:
        assert table.style.name == "Normal Table"
        (around,) = table._tbl.tblPr.iter(qn("w:tblBorders"))
        assert [rule.tag for rule in around] == [qn("w:top"), qn("w:bottom")]
        for cell in table.rows[0].cells:
            (below,) = cell._tc.iter(qn("w:tcBorders"))
            assert [rule.tag for rule in below] == [qn("w:bottom")]
        assert not [rule for row in table.rows[1:] for rule in row._tr.iter(qn("w:tcBorders"))]


def test_captions_stay_with_what_they_are_of_and_pages_have_numbers(report) -> None:
    document = docx.Document(str(report[1] / "report.docx"))
    captions = [paragraph for paragraph in document.paragraphs if paragraph.style.name == "Caption"]
    assert all(paragraph.paragraph_format.keep_with_next for paragraph in captions)
    assert fields(document.sections[0].header.paragraphs[0]) == [" PAGE "]
    for name in ("Normal", "Title", "Heading 1", "Heading 2", "Caption"):
        fonts = document.styles[name].element.rPr.rFonts
        assert fonts.get(qn("w:ascii")) == "Times New Roman"
        assert fonts.get(qn("w:asciiTheme")) is None, "the theme's font goes before one by name"


def test_cited_works_are_listed_and_no_others(report) -> None:
    text = [paragraph.text for paragraph in docx.Document(str(report[1] / "report.docx")).paragraphs]
    works = text[text.index("References") + 1 : -1]
    assert [work.split(",")[0] for work in works] == [
        *("Cousineau", "Freedman", "Morey", "Rouder", "Steiger", "Wobbrock", "Yuen")
    ]
    assert all("https://doi.org/10." in work and "*" not in work for work in works)
    assert "Davidson" not in " ".join(text)


def test_a_statistic_is_not_broken_at_the_end_of_a_line() -> None:
    said = "so F(1, 31) = 5.92, p < .001, partial η² = .16, 95% CI [.00, .38] and Factor A = B"
    assert unbroken(said).split(" ") == [
        *("so", "F(1,\xa031)\xa0=\xa05.92,", "p\xa0<\xa0.001,", "partial", "η²\xa0=\xa0.16,"),
        *("95%\xa0CI\xa0[.00,\xa0.38]", "and", "Factor", "A", "=", "B"),
    ]
    assert [piece for piece, is_symbol in pieces(unbroken(said)) if is_symbol] == ["F", "p"]


def test_symbols_without_a_number_are_in_italics_in_notes_and_methods() -> None:
    said = "F: multivariate, df (q, N - q). p adjusted by Holm. Paired t tests. Levels F and M; t of day."
    made = note_pieces(said)
    symbols = ["F", "df", "q", "N", "q", "p", "t", "t"]
    assert [piece for piece, is_symbol in made if is_symbol] == symbols
    assert "(q, N − q)" in "".join(piece for piece, _ in made)
    assert [piece for piece, is_symbol in note_pieces("the same exact F. BF₁₀ is") if is_symbol] == [
        "F",
        "BF",
    ]


def test_a_table_wider_than_the_page_gives_way(report) -> None:
    """Every column of numbers is whole at 9 points of Times, and the page holds eight of them."""
    row = ("s1, mean of 4 fits", "299.3", "[274.2, 324.4]", "39.4", "[-224.1, 303.0]", "37.5", "–", "–")
    header = ("Condition", "Threshold", "95% CI", "Tilt", "95% CI", "Spread", "fit p", "Trials")
    assert sum(widths_cm(Table("k", "t", header, (row,)), 16.0)) <= 16.0 + 1e-9


def test_the_file_is_one_that_the_schema_allows(report) -> None:
    """Properties of a table in the order that Word wants: it refuses or repairs a file with another."""
    _, folder = report
    document = docx.Document(str(folder / "report.docx"))
    order = ["tblStyle", "tblpPr", "tblOverlap", "bidiVisual", "tblStyleRowBandSize", "tblStyleColBandSize"]
    order += ["tblW", "jc", "tblCellSpacing", "tblInd", "tblBorders", "shd", "tblLayout", "tblCellMar"]
    order += ["tblLook", "tblCaption", "tblDescription"]
    for table in document.tables:
        names = [child.tag.split("}")[1] for child in table._tbl.tblPr]
        assert names == sorted(names, key=order.index)


@pytest.mark.skipif(
    shutil.which("soffice") is None or shutil.which("pdftotext") is None,
    reason="no soffice and pdftotext (libreoffice-writer, poppler-utils)",
)
def test_on_its_pages_each_caption_is_with_its_table(report, tmp_path) -> None:
    """Laid out by LibreOffice: a caption, the head of its table and the first row are on one page."""
    _, folder = report
    call = ["soffice", "--headless", f"-env:UserInstallation=file://{tmp_path}/profile"]
    call += ["--convert-to", "pdf", "--outdir", str(tmp_path), str(folder / "report.docx")]
    subprocess.run(call, check=True, capture_output=True, timeout=120)
    said = subprocess.run(["pdftotext", "-layout", str(tmp_path / "report.pdf"), "-"], capture_output=True)
    pages = [" ".join(page.split()) for page in said.stdout.decode().split("\f")]
    document = docx.Document(str(folder / "report.docx"))
    for number, table in enumerate(document.tables, start=1):
        (title,) = table._tbl.tblPr.iter(qn("w:tblCaption"))
        caption = f"Table {number} {title.get(qn('w:val'))}"
        (page,) = [page for page in pages if caption in page]
        first = [" ".join(cell.text.split()) for cell in table.rows[1].cells]
        assert first[-1] in page.split(caption)[1], caption
