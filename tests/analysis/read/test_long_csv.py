"""Anyone's CSV: what is read, what is decided and said, and what is refused with its line."""

from pathlib import Path

import pytest

from analysis.read.long_csv import LongData, read_long_table
from analysis.within.cell_means import cell_table
from experiments.errors import InputError


def read(path: Path, text: str | bytes, **options) -> LongData:
    file = path / "x.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_long_table(file, "id", "y", ["f"], **options)


def test_ids_keep_leading_zeros_and_letters_and_levels_keep_commas(tmp_path) -> None:
    data = read(
        tmp_path, '\ufeffid,y,f\n007,1,"a, b"\n007,2,None\n7,3,"a, b"\n7,4,None\nÄnne,1,"a, b"\nÄnne,2,None\n'
    )
    table = cell_table(data.rows, "id", "y", ["f"])
    assert table.participants == ("007", "7", "Änne")
    assert table.levels == (("a, b", "None"),)


def test_purely_numeric_ids_keep_their_zeros(tmp_path) -> None:
    data = read(tmp_path, "id,y,f\n007,1,1\n007,2,2\n7,3,1\n7,4,2\n")
    assert cell_table(data.rows, "id", "y", ["f"]).participants == ("007", "7")


def test_semicolons_and_decimal_commas_are_read_and_said(tmp_path) -> None:
    data = read(tmp_path, "id;y;f\n1;4,5;a\n1;3,25;b\n2;1;a\n2;2;b\n")
    assert data.rows["y"].tolist() == [4.5, 3.25, 1, 2]
    assert any("decimal commas in 'y'" in text for text in data.decisions)


@pytest.mark.parametrize("mark", ["", "NA", "."])
def test_missing_ratings_are_left_out_and_said(tmp_path, mark) -> None:
    data = read(tmp_path, f"id,y,f\n1,4,a\n1,{mark},b\n2,1,a\n2,2,b\n")
    assert len(data.rows) == 3
    assert data.decisions == ("1 row without a rating excluded (line 3)",)


def test_repeated_trials_count_once_where_they_agree(tmp_path) -> None:
    data = read(tmp_path, "id,y,f,t\n1,4,a,1\n1,4,a,1\n1,2,b,2\n", trial="t")
    assert len(data.rows) == 2
    assert data.decisions == ("1 repeated row of one trial was counted once (line 3)",)


def test_repeats_without_trial_numbers_are_kept_and_said(tmp_path) -> None:
    data = read(tmp_path, "id,y,f\n1,4,a\n1,4,a\n1,2,b\n2,3,a\n2,3,b\n")
    assert len(data.rows) == 5
    assert "1 have more" in data.decisions[0]


def test_levels_that_differ_in_case_are_said(tmp_path) -> None:
    assert (
        "differ only in case; they are separate levels"
        in read(tmp_path, "id,y,f\n1,4,a\n1,4,A\n").decisions[0]
    )


def test_blank_lines_and_blanks_around_cells_do_not_matter(tmp_path) -> None:
    data = read(tmp_path, "id , y,f\n1, 4 ,a \n\n1,2, b\n")
    assert data.rows["y"].tolist() == [4, 2]
    assert list(data.rows["f"]) == ["a", "b"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("id,y,f\n", "has a header but no rows"),
        ("id,x,f\n1,2,a\n", "no column 'y'"),
        ("id,y,f,y\n1,2,a,3\n", "two columns called 'y'"),
        ("id,y,f\n1,four,a\n", "'y' should be a number, got 'four' in line 2"),
        ("id,y,f\n1,4,a\n2,seven,a\n3,five,a\n", "'y' should be a number, got 'seven' in line 3"),
        ("id,y,f\n1,inf,a\n", "got 'inf' in line 2"),
        ("id,y,f\n1,1_0,a\n", "got '1_0' in line 2"),
        ("id,y,f\n1,2,a\n1,2,\n", "'f' is empty in line 3"),
        ("id,y,f\n,2,a\n", "'id' is empty in line 2"),
        ("id,y,f\n1,2,a\n1,2,a,b\n", "line 3 has 4 cells, the header 3"),
        ("id,y,f\n1,2\n", "line 2 has 2 cells, the header 3"),
        ('id,y,f\n1,2,"a\n', "line 2 opens is never closed"),
        ("id,y,f\n1,,a\n", "no rating in any row"),
        (b"id,y,f\nM\xfcller\x81,2,a\n", "not UTF-8"),
        (b"\x89PNG\x00\xff\xfe", "not UTF-8"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(tmp_path, text, message) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_one_trial_with_two_ratings_and_ratings_off_the_scale_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="id 1, t 1 occurs twice with different data, again in line 3"):
        read(tmp_path, "id,y,f,t\n1,4,a,1\n1,5,a,1\n", trial="t")
    with pytest.raises(InputError, match="'y' is 8 in line 2, outside the scale 1 to 7"):
        read(tmp_path, "id,y,f\n1,8,a\n", scale=(1, 7))


def test_no_file_a_folder_and_a_column_in_two_roles_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="no file"):
        read_long_table(tmp_path / "none.csv", "id", "y", ["f"])
    with pytest.raises(InputError, match="is a folder"):
        read_long_table(tmp_path, "id", "y", ["f"])
    with pytest.raises(InputError, match="'y' is named for two roles"):
        read_long_table(tmp_path / "x.csv", "id", "y", ["y"])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_lines_that_end_in_a_carriage_return_alone_are_read(tmp_path, encoding) -> None:
    path = tmp_path / "mac.csv"
    text = "id,y,f\r1,4,a\r1,5,b\r2,6,a\r2,x,b\r"
    path.write_bytes(text.replace("x", "7").encode(encoding))
    assert read_long_table(path, "id", "y", ["f"]).rows["y"].tolist() == [4, 5, 6, 7]
    path.write_bytes(text.encode(encoding))
    with pytest.raises(InputError, match="got 'x' in line 5; correct it, or leave the cell empty"):
        read_long_table(path, "id", "y", ["f"])


@pytest.mark.parametrize("mark", ["na", "null", "-"])
def test_an_unknown_mark_for_missing_is_refused_with_what_to_do(tmp_path, mark) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"id,y,f\n1,4,a\n1,{mark},b\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"leave the cell empty \(or write NA\) if it is missing"):
        read_long_table(path, "id", "y", ["f"])
