"""Wide tables are recognised, and made long without a loss."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.long_csv import read_long_table
from analysis.read.text_table import read_text_table
from analysis.read.wide import lengthen, wide_hint
from experiments.errors import InputError

WIDE = "id,age,sad_sharp,sad_blur,glad_sharp,glad_blur\n01,31,1,2,3,4\n02,40,5,6,,1\n"


def wide_file(folder: Path, text: str = WIDE) -> Path:
    path = folder / "wide.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_cell_becomes_a_row_and_the_rest_stays_next_to_it(tmp_path) -> None:
    table = lengthen(wide_file(tmp_path), "{face}_{blur}", "score")
    assert table.factors == ("face", "blur")
    assert table.beside == ("id", "age")
    assert table.rows.values.tolist() == [
        ["01", "31", "sad", "sharp", "1"],
        ["01", "31", "sad", "blur", "2"],
        ["01", "31", "glad", "sharp", "3"],
        ["01", "31", "glad", "blur", "4"],
        ["02", "40", "sad", "sharp", "5"],
        ["02", "40", "sad", "blur", "6"],
        ["02", "40", "glad", "sharp", ""],
        ["02", "40", "glad", "blur", "1"],
    ]


def test_a_long_command_on_a_wide_table_says_the_way_out(tmp_path) -> None:
    with pytest.raises(InputError, match=r"the table looks wide .*--columns '\{factor1\}_\{factor2\}'"):
        read_long_table(wide_file(tmp_path), "id", "score", ["face", "blur"])


@pytest.mark.parametrize(
    ("header", "pattern"),
    [
        (["id", "t1", "t2", "t3"], "t{factor1}"),
        (["id", "rate.a", "rate.b", "rate.c"], "rate.{factor1}"),
        (["id", "face", "blur", "score"], None),
        (["a_id", "face", "rating_1"], None),
    ],
)
def test_wide_headers_are_distinguished_from_long_ones(header, pattern) -> None:
    hint = wide_hint(header)
    assert (f"--columns '{pattern}'" in hint) if pattern else hint == ""


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ("face_blur", "names no factor"),
        ("{a}{b}", "must have something between them"),
        ("{a}_{a}", "names a factor twice"),
        ("{x}-{y}", "no column of wide.csv fits"),
        ("{age}_{blur}", "has a column 'age'"),
    ],
)
def test_patterns_that_cannot_be_used_end_in_one_line(tmp_path, pattern, said) -> None:
    with pytest.raises(InputError, match=said):
        lengthen(wide_file(tmp_path), pattern, "score")


@pytest.mark.parametrize("header", ["id,t1,t2,t1", "id,age,t1,t2,age"])
def test_two_columns_of_one_name_are_refused(tmp_path, header) -> None:
    path = tmp_path / "w.csv"
    path.write_text(f"{header}\n{','.join('12345'[: header.count(',') + 1])}\n")
    with pytest.raises(InputError, match=r"w.csv has two columns called '(t1|age)'; rename one"):
        lengthen(path, "t{time}", "score")


def test_columns_that_a_pattern_fits_by_chance_can_be_kept(tmp_path: Path) -> None:
    """Columns `id, slow, fast`: the id is not a condition."""
    path = tmp_path / "w.csv"
    path.write_text("id,slow,fast\na,3,4\nb,5,6\n")
    with pytest.raises(InputError, match=r"fits every column of w.csv, .*--keep id"):
        lengthen(path, "{condition}", "score")
    with pytest.raises(InputError, match="has no column 'ids'"):
        lengthen(path, "{condition}", "score", ["ids"])
    rows = lengthen(path, "{condition}", "score", ["id"]).rows
    assert rows.values.tolist() == [
        ["a", "slow", "3"],
        ["a", "fast", "4"],
        ["b", "slow", "5"],
        ["b", "fast", "6"],
    ]


def test_a_name_that_fits_in_two_ways_is_refused(tmp_path) -> None:
    path = wide_file(tmp_path, "id,very_sad_blur\n1,2\n")
    with pytest.raises(InputError, match="in two ways"):
        lengthen(path, "{face}_{blur}", "score")


def test_columns_that_are_asked_for_are_not_cells_of_a_wide_table(tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("case,q1,q2,q3\na,1,2,3\nb,2,3,4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"no column 'id'; its columns are case, q1, q2, q3 \("):
        read_text_table(path, ["q1", "q2", "q3", "id"])
    with pytest.raises(InputError, match="the table looks wide"):
        read_text_table(path, ["id", "score"])


@pytest.mark.parametrize("command", ["anova", "mixed", "ordinal"])
def test_ids_that_occur_once_are_asked_about_and_not_taken_for_groups(command: str, tmp_path: Path) -> None:
    long = tmp_path / "long.csv"
    rows = "\n".join(f"{i},{'ab'[i % 2]},{'xy'[i % 3 % 2]},{i % 5}" for i in range(24))
    long.write_text(f"id,time,diag,y\n{rows}\n", encoding="utf-8")
    wide = tmp_path / "wide.csv"
    rows = "\n".join(f"{i},{i % 3},{i % 4},{i % 5},{i % 7}" for i in range(12))
    wide.write_text(f"subject,near_NB,near_MB,far_NB,far_MB\n{rows}\n", encoding="utf-8")
    for file, options, said in (
        (long, "--participant id --rating y --within time", "is this not the participant column"),
        (wide, "--participant subject --rating near_NB --within near_MB", "'{factor1}_{factor2}'"),
    ):
        done = CliRunner().invoke(app, [command, str(file), *options.split()])
        output = str(done.exception)
        assert isinstance(done.exception, InputError)
        assert "is in only one row" in output
        assert said in output
        assert "--between" not in output
