"""Tables and sentences in the terminal: lines are wider than 80 columns only for what cannot be broken."""

from io import BytesIO

import docx

from analysis.report.contents import Contents, DrawnPart
from analysis.report.formats import Table, as_text, wrap
from analysis.report.numbers import heading_pieces, signed_cell, with_minus
from analysis.report.word import as_docx
from analysis.report.write import render_report


def lines_of(header: tuple[str, ...], *rows: tuple[str, ...], text_columns: int = 1) -> list[str]:
    return as_text(Table("k", "Title", header, rows, text_columns)).splitlines()


def test_a_long_word_behind_a_short_one_is_cut() -> None:
    """Its line could not be broken at a space, and was begun for ever."""
    lines = lines_of(("Effect", *["x" * 12] * 5), ("ab cdefghijklmnopqrst", *["1"] * 5))
    assert max(map(len, lines)) == 12 + 5 * (2 + 12)  # the first column is 12 wide at least
    assert "".join(line[:12].strip() for line in lines[4:-1]) == "abcdefghijklmnopqrst"


def test_wide_columns_that_are_not_the_first_are_broken_at_spaces() -> None:
    said = "mean of all ratings, different people for each item"
    lines = lines_of(
        ("Form", "ICC", "95% CI", "F (df)", "Of what"),
        ("ICC(1,1)", ".172", "[.060, .500]", "5.97 (7, 184)", said),
    )
    assert max(map(len, lines)) <= 80
    assert " ".join(" ".join(line[44:] for line in lines[4:-1]).split()) == said


def test_a_path_is_never_cut() -> None:
    """It is there to be copied, and is wider than the terminal rather than in two."""
    path = "/data/" + "x" * 100
    assert wrap(f"written to {path}: report.html") == ["written to", f"  {path}:", "  report.html"]


def test_a_table_that_fits_is_left_as_it_is() -> None:
    lines = lines_of(("Effect", "p of the whole"), ("Face", ".001"))
    assert lines[2:5] == ["Effect  p of the whole", "─" * 22, "Face              .001"]


def italic(*header: str) -> list[str]:
    return [piece for head in heading_pieces(header) for piece, is_symbol in head if is_symbol]


def test_symbols_at_the_head_of_columns_are_in_italics() -> None:
    assert heading_pieces(["F (df)"]) == [[("F", True), (" (", False), ("df", True), (")", False)]]
    assert italic("Effect", "F", "df", "p (ranks)", "SE") == ["F", "df", "p", "SE"]
    assert italic("Factor", "W/L/T", "t", "p") == ["t", "p"]


def test_levels_called_as_a_symbol_are_not_in_italics() -> None:
    assert italic("Clip", "M", "F") == []
    assert italic("Gender: M", "Gender: F", "p") == ["p"]


def test_minus_is_before_numbers_alone() -> None:
    assert (
        with_minus("t(11) = -6.28, [-.05, 0.30], 7-9, P-1 and x - y")
        == "t(11) = −6.28, [−.05, 0.30], 7-9, P-1 and x - y"
    )
    assert with_minus("-3dB, -1.5dB, a/-3 and 1.2e-5, -1.2e-5") == "-3dB, -1.5dB, a/-3 and 1.2e-5, −1.2e-5"


def test_ids_and_labels_in_tables_keep_their_hyphens() -> None:
    for numbers in ("-0.31 (0.12)", "[-.05, 0.30]", "-1.2e-05", "-3"):
        assert signed_cell(numbers, True) == numbers.replace("-", "−", 1)
        assert signed_cell(numbers, False) == numbers
    for name in ("id -7", "a/-3", "-3dB", "-3 dB", "_-3"):
        assert signed_cell(name, True) == name


def test_tables_of_reports_keep_the_names_in_their_first_column() -> None:
    table = Table("k", "Title", ("Gender", "M", "F"), (("-3dB", "-1.5", "id -7"), ("-7", "2", "-.5")), 1)
    contents = Contents("n", "Study", "Led", "rows.csv", False, 2, (), (), (), "Method", {})
    part = DrawnPart("", (), table, (), (), "", (), ())
    html = render_report("report.html.j2", contents, (part,))
    rows = docx.Document(BytesIO(as_docx(contents, (part,), "1"))).tables[0].rows
    cells = [cell.text for row in rows for cell in row.cells]
    assert cells == ["Gender", "M", "F", "-3dB", "−1.5", "id -7", "-7", "2", "−.5"]
    assert [cell for cell in cells if f">{cell}</t" not in html] == []
    assert "<i>" not in html.split("<thead>")[1].split("</table>")[0]
