"""What a spreadsheet would run as a formula is text, and comes back as it was."""

import csv
import io

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from table_files.formulas import csv_text, guarded_cell, guarded_csv, guarded_table, unguarded_cell

FORMULAS = [
    "=1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", "\n=1", "-", "+fast",
    "＝1+1", "＋1", "－1+1", "＠SUM(A1)", "﹦1",
    '=HYPERLINK("http://example.org";"a")', "=cmd|' /C calc'!A0",
]  # fmt: skip


@pytest.mark.parametrize("cell", FORMULAS)
def test_every_form_of_a_formula_is_text(cell: str) -> None:
    assert guarded_cell(cell).startswith("'")
    assert unguarded_cell(guarded_cell(cell)) == cell


@pytest.mark.parametrize("cell", ["-1.5", "+2", "1e-3", "-.5", "", "a=b", "'=1", "well ;-)", "1;-2", "a;b"])
def test_numbers_and_texts_stay(cell: str) -> None:
    assert guarded_cell(cell) == cell


@pytest.mark.parametrize("separator", [";", "\t", "\n", "\r", "\r\n"])
def test_no_part_of_a_cell_runs_where_a_spreadsheet_splits_cells_at_semicolons(separator: str) -> None:
    guarded = guarded_cell(f"thanks{separator}=1+1{separator}+cmd{separator}-2")
    assert guarded.split(separator) == ["thanks", "'=1+1", "'+cmd", "-2"]


cells = st.text(alphabet="=+-@＝＠'\";,\t\r\n 1a.e)(", max_size=8)


@example([["a", "x;-1,1+A1"]])  # a formula where the comma is the decimal sign
@example([["a", "-1,1+A1"], ["-1;", "+1"]])
@given(st.lists(st.lists(cells, min_size=2, max_size=4), min_size=1, max_size=4))
def test_the_search_of_a_piece_misses_no_cell(rows: list[list[str]]) -> None:
    [guarded] = guarded_csv([csv_text(rows).encode()])
    assert guarded == guarded_table(rows)
    read = list(csv.reader(io.StringIO(guarded.decode(), newline="")))
    assert read == [[guarded_cell(cell) for cell in row] for row in rows]


@given(cells)
def test_guarding_twice_changes_nothing_more_and_is_taken_back(cell: str) -> None:
    assert guarded_cell(guarded_cell(cell)) == guarded_cell(cell)
    text = cell.replace("'", "")
    assert unguarded_cell(guarded_cell(text)) == text


def test_a_long_comment_is_guarded_too() -> None:
    comment = "=" + "a" * 200_000
    [guarded] = guarded_csv([f"{comment}\n".encode()])
    assert guarded == f"'{comment}\n".encode()
