"""Tables and sentences in the terminal: lines are wider than 80 columns only for what cannot be broken."""

from analysis.report.formats import Table, as_text, wrap
from analysis.report.italics import heading_pieces, signed


def lines_of(header: tuple[str, ...], *rows: tuple[str, ...], text_columns: int = 1) -> list[str]:
    return as_text(Table("k", "Title", header, rows, text_columns)).splitlines()


def test_a_long_word_behind_a_short_one_is_cut() -> None:
    """Its line could not be broken at a space, and was begun for ever."""
    lines = lines_of(("Effect", *["x" * 12] * 5), ("ab cdefghijklmnopqrst", *["1"] * 5))
    assert max(map(len, lines)) == 12 + 5 * (2 + 12)  # the first column is 12 wide at least
    assert "".join(line[:12].strip() for line in lines[4:-1]) == "abcdefghijklmnopqrst"


def test_wide_columns_that_are_not_the_first_are_broken_at_spaces() -> None:
    said = "mean of all ratings, people differ from item to item"
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


def test_symbols_at_the_head_of_columns_are_in_italics() -> None:
    assert heading_pieces("F (df)") == [("F", True), (" (", False), ("df", True), (")", False)]
    assert not any(italic for _, italic in heading_pieces("W/L/T"))
    assert not any(italic for _, italic in heading_pieces("Factor"))


def test_minus_stands_before_numbers_alone() -> None:
    assert (
        signed("t(11) = -6.28, [-.05, 0.30], 7-9, P-1 and x - y")
        == "t(11) = −6.28, [−.05, 0.30], 7-9, P-1 and x - y"
    )
