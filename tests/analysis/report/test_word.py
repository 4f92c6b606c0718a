"""The Word file says what the page says, and the same data give the same bytes."""

from io import BytesIO
from zipfile import ZipFile

import docx
import pytest

from analysis.plans.clip_rating import PLAN, READING, contents
from analysis.plans.prepare import prepare
from analysis.read.study_answers import load_csv
from analysis.report.column_widths import widths_cm
from analysis.report.formats import Table
from analysis.report.italics import pieces
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
