"""The Word file says what the page says, and the same data give the same bytes."""

from io import BytesIO
from zipfile import ZipFile

import docx
import pytest
from docx.oxml.ns import qn

from analysis.plans.clip_rating import PLAN, READING, contents
from analysis.plans.plan import prepare
from analysis.read.study_answers import load_csv
from analysis.report.formats import Table, widths_cm
from analysis.report.numbers import pieces
from analysis.report.write import write_report
from experiments.load import load_experiment
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
    text = [paragraph.text for paragraph in document.paragraphs]
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
    row = ("a label of many words that is longer than any line of a page can be, and longer still", "-1.25")
    widths = widths_cm(Table("k", "t", ("Effect", "F"), (row,) * 3), room)
    assert widths[1] == widths_cm(Table("k", "t", ("Effect", "F"), (("a", row[1]),)), 16.0)[1]
    assert (abs(sum(widths) - room) < 1e-9) is sums
    assert widths[0] >= 2.4


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
            assert paragraph.text.startswith(f"{label} {number}. ")
            assert len(paragraph.text) > len(f"{label} {number}. ")
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
        assert f"{len(table.rows) - 1} rows" in said.get(qn("w:val"))


def test_notes_begin_as_such_and_are_under_what_they_are_of(report) -> None:
    said, folder = report
    document = docx.Document(str(folder / "report.docx"))
    notes = [paragraph for paragraph in document.paragraphs if paragraph.style.name == "Body Text 3"]
    assert notes
    for note in notes:
        assert note.text.startswith("Note. ")
        assert note.runs[0].italic
        before = note._p.getprevious()
        is_table = before.tag == qn("w:tbl")
        assert is_table or "Figure" in "".join(text.text or "" for text in before.iter(qn("w:t")))
    first = said.parts[0].tables[0]
    assert any(first.notes[0][:30] in note.text for note in notes)


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
