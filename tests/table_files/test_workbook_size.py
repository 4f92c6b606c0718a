"""Workbooks of a few kilobytes that unfold to all memory are refused before they are opened."""

import zipfile

import openpyxl
import pytest

from analysis.read.long_csv import read_long_table
from experiments.errors import InputError
from table_files import workbook as workbook_reader
from table_files.workbook import _pages

RELATIONS, TYPES = "xl/_rels/workbook.xml.rels", "[Content_Types].xml"
SHEET = "xl/worksheets/sheet1.xml"
END = "</sheetData>"
FURTHEST = "XFD1048576"


def workbook(path, old: str, new: str, first: dict[str, bytes] | None = None, name: str = SHEET):
    """A small table; in its sheet's XML, called `name`, `new` replaces `old`; `first` comes before."""
    book = openpyxl.Workbook()
    for row in [("id", "face", "score"), ("a", "x", 1), ("b", "x", 2)]:
        book.active.append(row)
    book.save(path)
    with zipfile.ZipFile(path) as plain:
        parts = {name: plain.read(name) for name in plain.namelist()}
    parts[SHEET] = parts[SHEET].decode().replace(old, new).encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as changed:
        for part, content in ({**(first or {})} | parts).items():
            if name != SHEET and part in (RELATIONS, TYPES):
                content = content.replace(SHEET.encode(), name.encode())
            changed.writestr(name if part == SHEET else part, content)
    return path


def read(path) -> int:
    return len(read_long_table(path, "id", "score", ["face"]).rows)


def cell(at: str) -> str:
    return f'<row r="{at.lstrip("XFDA")}"><c r="{at}"><v>1</v></c></row>'


@pytest.mark.parametrize(
    ("new", "said"),
    [
        (f'{END}<mergeCells><mergeCell ref="A5:{FURTHEST}"/></mergeCells>', "has merged cells A5:XFD1048576"),
        (f'{END}<hyperlinks><hyperlink ref="A5:{FURTHEST}" location="x"/></hyperlinks>', "a link over cells"),
        (f'{END}<mergeCells><mergeCell ref="$A$5:$XFD$1048576"/></mergeCells>', "merged cells $A$5:$XFD"),
        (f"{END}<mergeCells><mergeCell><ref>A5:{FURTHEST}</ref></mergeCell></mergeCells>", "as an element"),
        (f'{END}<hyperlinks><hyperlink ref="A:XFD" location="x"/></hyperlinks>', "a link over cells A:XFD"),
        (cell(FURTHEST) + END, "as far as row 1,048,576 and column 16,384 of 'Sheet', 17,179,869,184 with"),
        (
            f'<row r="1048576">{"<c/>" * 200}</row>{END}',
            "row 1,048,576 and column 200 of 'Sheet', 209,715,200",
        ),
        (f'<row r="1048575"/><row>{"<x/>" * 200}</row>{END}', "row 1,048,576 and column 200"),
        (
            f'{END}<hyperlinks><hyperlink ref="{FURTHEST}" location="x"/></hyperlinks>',
            "as far as row 1,048,576",
        ),
    ],
    ids=["merged", "link", "absolute", "element", "columns", "far cell", "row", "next row", "far link"],
)
def test_a_small_file_with_billions_of_cells_is_refused(tmp_path, new, said) -> None:
    with pytest.raises(InputError) as caught:
        read(workbook(tmp_path / "a.xlsx", END, new))
    assert said in str(caught.value)
    assert str(caught.value).endswith("save its sheet as CSV")


MANY = f"<row>{'<c/>' * 1000}</row>{END}"


@pytest.mark.parametrize("first", [b"<a>", b"no XML", b""], ids=["cut off", "text", "empty"])
def test_a_broken_part_before_the_sheet_ends_no_count(tmp_path, monkeypatch, first) -> None:
    monkeypatch.setattr(workbook_reader, "MAX_ELEMENTS", 1000)
    with pytest.raises(InputError, match="has more than 500 cells"):
        read(workbook(tmp_path / "a.xlsx", END, MANY, {"customXml/item1.xml": first}))


def test_a_note_over_billions_of_cells_is_refused(tmp_path) -> None:
    notes = f'<comments><commentList><comment ref="A1:{FURTHEST}"/></commentList></comments>'.encode()
    with pytest.raises(InputError, match="a note over cells A1:XFD1048576, 17,179,869,184 in all"):
        read(workbook(tmp_path / "a.xlsx", END, END, {"xl/comments1.xml": notes}))


def test_a_sheet_of_any_name_is_counted(tmp_path, monkeypatch) -> None:
    assert read(workbook(tmp_path / "b.xlsx", END, END, name="xl/worksheets/sheet1.bin")) == 2
    monkeypatch.setattr(workbook_reader, "MAX_ELEMENTS", 1000)
    with pytest.raises(InputError, match="has more than 500 cells"):
        read(workbook(tmp_path / "a.xlsx", END, MANY, name="xl/worksheets/sheet1.bin"))


def test_a_picture_with_a_document_type_is_none_of_the_table(tmp_path) -> None:
    picture = b'<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "svg11.dtd"><svg/>'
    assert read(workbook(tmp_path / "a.xlsx", END, END, {"xl/media/image1.svg": picture})) == 2


def test_a_row_behind_the_last_of_any_sheet_ends_in_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match="not an Excel workbook that can be read"):
        read(workbook(tmp_path / "a.xlsx", END, f'<row r="9000000"><c/></row>{END}'))


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workbook_reader, "MAX_BYTES", 5 << 20)
    path = workbook(tmp_path / "a.xlsx", END, " " * (6 << 20) + END)
    assert path.stat().st_size < 1 << 16
    with pytest.raises(InputError, match=r"a.xlsx unpacks to 6 MiB, and at most 5 are read; save its sheet"):
        read(path)


def test_too_many_cells_are_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workbook_reader, "MAX_ELEMENTS", 1000)
    with pytest.raises(InputError, match="has more than 500 cells; save its sheet as CSV"):
        read(workbook(tmp_path / "a.xlsx", END, MANY))


def test_a_document_type_is_refused(tmp_path) -> None:
    entities = '<!DOCTYPE a [<!ENTITY b "cccccccc">]><worksheet'
    with pytest.raises(InputError, match="holds a document type"):
        read(workbook(tmp_path / "a.xlsx", "<worksheet", entities))


def test_a_column_formatted_to_the_last_row_is_nothing(tmp_path) -> None:
    assert read(workbook(tmp_path / "a.xlsx", END, '<row r="1048576"><c r="C1048576"/></row>' + END)) == 2


def test_rows_behind_the_last_value_are_not_held(tmp_path) -> None:
    path = workbook(tmp_path / "a.xlsx", END, '<row r="90000"><c r="C90000"/></row>' + END)
    assert len(_pages(path, path.stat().st_mtime_ns, formulas=False)["Sheet"].rows) == 3


def test_an_empty_sheet_with_a_formatted_row_far_below_holds_no_rows(tmp_path) -> None:
    book = openpyxl.load_workbook(workbook(tmp_path / "a.xlsx", END, END))
    book.create_sheet("Empty")["C90000"].number_format = "0.00"
    book.save(tmp_path / "b.xlsx")
    pages = _pages(tmp_path / "b.xlsx", 0, formulas=False)
    assert pages["Empty"].rows == []
    assert read(tmp_path / "b.xlsx") == 2


def test_a_formula_never_calculated_in_a_row_without_values_is_refused(tmp_path) -> None:
    row = '<row r="7"><c r="A7"/><c r="C7"><f>1+1</f></c></row>'
    with pytest.raises(InputError, match=r"row 7 of 'score' holds the formula =1\+1"):
        read(workbook(tmp_path / "a.xlsx", END, row + END))


def test_a_sheet_cut_off_ends_in_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match="not an Excel workbook that can be read"):
        read(workbook(tmp_path / "a.xlsx", END, ""))
