"""Numbers that can be read two ways are refused with both readings; far-off ratings are named."""

from pathlib import Path

import pytest

from analysis.read.long_csv import read_long_table
from analysis.read.model_csv import read_model_input
from experiments.errors import InputError


def file_of(tmp_path: Path, ratings: list[str]) -> Path:
    path = tmp_path / "t.csv"
    rows = [f'{i // 2},{"ab"[i % 2]},"{rating}"' for i, rating in enumerate(ratings)]
    path.write_text("\n".join(["id,a,y", *rows]), encoding="utf-8")
    return path


def read(path: Path):
    return read_long_table(path, "id", "y", ["a"])


@pytest.mark.parametrize(
    ("ratings", "beside"),
    [(["1,003", "950"], "950"), (["1,003", "2,500"], ""), (["1,003", "950.5"], "950.5")],
)
def test_a_comma_that_may_part_thousands_is_refused_with_both_readings(tmp_path, ratings, beside) -> None:
    with pytest.raises(InputError) as caught:
        read(file_of(tmp_path, ratings))
    said = str(caught.value)
    assert "'1,003' of 'y' in line 2 can be read as 1.003 or as 1003" in said
    assert (f"also found: {beside}" in said) == bool(beside)


@pytest.mark.parametrize(
    ("ratings", "values"),
    [
        (["1,003", "2,5"], [1.003, 2.5]),
        (["0,125", "3"], [0.125, 3]),
        (["0,125", "3,250"], [0.125, 3.25]),
        (["1,0035", "3,250"], [1.0035, 3.25]),
    ],
)
def test_a_column_that_shows_its_decimal_comma_is_read(tmp_path, ratings, values) -> None:
    assert read(file_of(tmp_path, ratings)).rows["y"].tolist() == values


def test_a_rating_far_from_the_others_is_named(tmp_path) -> None:
    ratings = [str(1 + i % 7) for i in range(60)]
    assert not read(file_of(tmp_path, ratings)).decisions
    (said,) = read(file_of(tmp_path, [*ratings, "77", "3"])).decisions
    assert "'y' has 77 (line 62), far from the others (1 to 7)" in said


def test_numbers_that_are_not_a_scale_are_left_alone(tmp_path) -> None:
    reaction_times = [str(300 + 17 * (i % 23)) for i in range(60)]
    assert not read(file_of(tmp_path, [*reaction_times, "2900"])).decisions


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (["id"], "named as participant and as item"),
        (["person"], "items and participants are the same"),
        (["y"], "two roles"),
    ],
)
def test_the_participant_is_not_an_item(tmp_path, item, message) -> None:
    path = tmp_path / "t.csv"
    rows = [f"{i // 4},x{i // 4},{'ab'[i % 2]},{i % 5}" for i in range(24)]
    path.write_text("\n".join(["id,person,a,y", *rows]))
    with pytest.raises(InputError, match=message):
        read_model_input(path, "id", "y", ["a"], item)


def test_a_point_that_may_part_thousands_is_refused_with_both_readings(tmp_path) -> None:
    with pytest.raises(InputError, match=r"'1\.003' of 'y' in line 2 can be read as 1\.003 or as 1003"):
        read(file_of(tmp_path, ["1.003", "950"]))


@pytest.mark.parametrize(
    "ratings", [["1.003", "2.5", "950"], ["0.125", "950"], ["4.125", "3.875"], ["1.003", "7"]]
)
def test_a_column_that_shows_its_decimal_point_is_read(tmp_path, ratings) -> None:
    assert read(file_of(tmp_path, ratings)).rows["y"].tolist() == [float(text) for text in ratings]


@pytest.mark.parametrize(
    ("code", "others"), [("-99", range(1, 8)), ("999", range(101)), ("-9", [0.5, 1, 1.5, 2])]
)
def test_codes_for_missing_are_named_however_many_they_are(tmp_path, code, others) -> None:
    ratings = [str(value) for value in others] * 6
    assert not read(file_of(tmp_path, ratings)).decisions
    (said,) = read(file_of(tmp_path, [*ratings, *[code] * 12])).decisions
    assert f"'y' has {code} (lines " in said
    assert "leave them empty, or reject them with --scale" in said


@pytest.mark.parametrize("ratings", [["90", "95", "99"] * 9, ["-9", "-8", "3"] * 9])
def test_a_code_among_the_others_is_a_number(tmp_path, ratings) -> None:
    assert not read(file_of(tmp_path, ratings)).decisions


def test_empty_rows_below_a_table_are_left_out(tmp_path) -> None:
    path = file_of(tmp_path, ["1", "2", "3", "4"])
    path.write_text(f"{path.read_text()}\n,,\n,,\n")
    table = read(path)
    assert table.rows["y"].tolist() == [1, 2, 3, 4]
    assert list(table.decisions) == [
        "rows without a value in any column that is used were excluded (lines 6, 7)"
    ]
    path.write_text("id,a,y\n,,\n")
    with pytest.raises(InputError, match="has a header but no rows"):
        read(path)


@pytest.mark.parametrize("first", ["sep=|", "id|a|y"])
def test_a_first_line_that_is_not_a_header_is_shown_with_what_to_do(tmp_path, first) -> None:
    path = file_of(tmp_path, ["1", "2"])
    path.write_text(f"{first}\n{path.read_text()}")
    with pytest.raises(InputError, match=r"its first line is .*; it should have the column names"):
        read(path)


def with_another(tmp_path: Path, other: list[str], ratings: list[str]) -> Path:
    path = tmp_path / "t.csv"
    rows = [f"{i // 2};{'ab'[i % 2]};{x};{y}" for i, (x, y) in enumerate(zip(other, ratings, strict=True))]
    path.write_text("\n".join(["id;a;x;y", *rows]), encoding="utf-8")
    return path


def test_points_next_to_another_columns_decimal_comma_are_refused_with_both_readings(tmp_path) -> None:
    path = with_another(tmp_path, ["2,5", "NA", "3"], ["1.003", "2.500", ""])
    with pytest.raises(InputError) as caught:
        read(path)
    said = str(caught.value)
    assert "'1.003' of 'y' in line 2 can be read as 1.003 or as 1003 (also found: 2,5 of 'x')" in said


@pytest.mark.parametrize(
    "other", [["2.5", "3"], ["1,003", "2,500"], ["yes, 2,5", "2,5"], ["2", "3"], ["", ""]]
)
def test_points_are_decimal_where_no_other_column_has_a_decimal_comma(tmp_path, other) -> None:
    assert read(with_another(tmp_path, other, ["1.003", "2.500"])).rows["y"].tolist() == [1.003, 2.5]


def test_a_shown_decimal_point_is_one_next_to_another_columns_comma(tmp_path) -> None:
    assert read(with_another(tmp_path, ["2,5", "3"], ["1.003", "2.5"])).rows["y"].tolist() == [1.003, 2.5]
