"""Workbooks of a few kilobytes that unfold to all memory are refused before they are opened."""

import zipfile

import openpyxl
import pytest

from analysis.read.files import workbook_size
from analysis.read.long_csv import read_long_table
from experiments.errors import InputError

SHEET = "xl/worksheets/sheet1.xml"
END = "</sheetData>"
FURTHEST = "XFD1048576"


def workbook(path, old: str, new: str):
    """A small table; in its sheet's XML `old` gives way to `new`."""
    book = openpyxl.Workbook()
    for row in [("id", "face", "score"), ("a", "x", 1), ("b", "x", 2)]:
        book.active.append(row)
    book.save(path)
    with zipfile.ZipFile(path) as plain:
        parts = {name: plain.read(name) for name in plain.namelist()}
    parts[SHEET] = parts[SHEET].decode().replace(old, new).encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as changed:
        for name, content in parts.items():
            changed.writestr(name, content)
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
        (cell(FURTHEST) + END, "has a cell XFD1048576, so that 17,179,869,184 cells lie before it"),
    ],
    ids=["merged", "link", "far cell"],
)
def test_a_small_file_with_billions_of_cells_is_refused(tmp_path, new, said) -> None:
    with pytest.raises(InputError) as caught:
        read(workbook(tmp_path / "a.xlsx", END, new))
    assert said in str(caught.value)
    assert str(caught.value).endswith("or save its sheet as CSV")


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workbook_size, "MAX_BYTES", 5 << 20)
    path = workbook(tmp_path / "a.xlsx", END, " " * (6 << 20) + END)
    assert path.stat().st_size < 1 << 16
    with pytest.raises(InputError, match=r"a.xlsx unpacks to 6 MiB, and at most 5 are read; save its sheet"):
        read(path)


def test_too_many_cells_are_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(workbook_size, "MAX_ELEMENTS", 1000)
    with pytest.raises(InputError, match="has more than 500 cells; save its sheet as CSV"):
        read(workbook(tmp_path / "a.xlsx", END, f"<row>{'<c/>' * 1000}</row>{END}"))


def test_a_document_type_is_refused(tmp_path) -> None:
    entities = '<!DOCTYPE a [<!ENTITY b "cccccccc">]><worksheet'
    with pytest.raises(InputError, match="holds a document type"):
        read(workbook(tmp_path / "a.xlsx", "<worksheet", entities))


def test_a_column_formatted_to_the_last_row_is_nothing(tmp_path) -> None:
    assert read(workbook(tmp_path / "a.xlsx", END, '<row r="1048576"><c r="C1048576"/></row>' + END)) == 2


def test_a_sheet_cut_off_ends_in_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match="not an Excel workbook that can be read"):
        read(workbook(tmp_path / "a.xlsx", END, ""))
