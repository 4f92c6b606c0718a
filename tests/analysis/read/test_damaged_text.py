"""Encodings, damaged quotes, 100,000 columns, numbers out of all bounds: read, or refused in one line."""

import numpy as np
import openpyxl
import pandas as pd
import pyreadstat
import pytest

from analysis.read.long_csv import read_long_table
from analysis.read.text_table import _names_to_read
from analysis.within.cell_means import cell_table
from experiments.errors import InputError

TEXT = "id,face,score\np1,calm,3\np1,Ärm,4\np2,calm,5\np2,Ärm,1\n"


def ratings(path) -> list[tuple[str, str, float]]:
    rows = read_long_table(path, "id", "score", ["face"]).rows
    return list(
        rows[["id", "face", "score"]].astype({"id": str, "face": str}).itertuples(index=False, name=None)
    )


EXPECTED = [("p1", "calm", 3.0), ("p1", "Ärm", 4.0), ("p2", "calm", 5.0), ("p2", "Ärm", 1.0)]


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32", "utf-8-sig"])
@pytest.mark.parametrize("separator", [",", "\t"])
def test_text_with_a_byte_order_mark_is_read(tmp_path, encoding, separator) -> None:
    path = tmp_path / "a.csv"
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    path.write_bytes((mark + TEXT.replace(",", separator).replace("\n", "\r\n")).encode(encoding))
    assert ratings(path) == EXPECTED


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("\ufeffid,face\nx".encode("utf-16-le")[:-1], r"a.csv is not UTF-16 text .*; save it as CSV UTF-8"),
        (TEXT.encode("cp1250") + b"\x81", r"a.csv is not UTF-8 text .*; save it as CSV UTF-8"),
    ],
    ids=["cut off", "no letter of Windows-1252"],
)
def test_other_encodings_say_what_to_do(tmp_path, content, said) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        ratings(tmp_path / "a.csv")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            ['p1,"calm,3', "p1,Ärm,4"],
            "the double quote that line 2 opens is never closed; close it or delete it",
        ),
        (["p1,calm,3", 'p1,"Ärm"x,4'], "line 3 .* goes on behind it; .*twice"),
        (['p1,"calm,3', 'p2,"Ärm,4'], "line 2 opens .* line 3 closes.*goes on behind it"),
    ],
    ids=["never closed", "text behind", "two that swallow a row"],
)
def test_a_damaged_quote_is_named(tmp_path, lines, said) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["id,face,score", *lines]), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        ratings(path)


def test_a_row_that_a_quote_runs_through_names_both_lines(tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text('id,face,score\np1,"calm,3\np1,b,4\np2,c",5,6\n', encoding="utf-8")
    with pytest.raises(
        InputError,
        match=r"line 2 opens a double quote that line 4 closes, .* one row of 4 cells, the header 3",
    ):
        ratings(path)


def test_quotes_inside_a_cell_without_quotes_are_text(tmp_path) -> None:
    path = tmp_path / "a.tsv"
    path.write_text('id\tface\tscore\np1\t5" x\t3\np1\tb"\t4\np2\t5" x\t5\np2\tb"\t1\n', encoding="utf-8")
    assert [row[1] for row in ratings(path)] == ['5" x', 'b"', '5" x', 'b"']
    path.write_text('id\tface\tscore\np1\t5" x\t3\np1\tb\t4\t9\n', encoding="utf-8")
    with pytest.raises(InputError, match="line 3 has 4 cells, the header 3"):
        ratings(path)


class Names(list[str]):
    def count(self, value) -> int:
        pytest.fail(f"the whole header is searched for {value}: 100,000 names take 10,000,000,000 steps")


def test_names_of_columns_are_counted_once_for_all() -> None:
    header = Names(["id", "face", "score", "score", "x", "x"])
    assert _names_to_read("a.csv", header, ["id", "face"], ["x of others"]) == ["id", "face"]
    with pytest.raises(InputError, match="two columns called 'score'"):
        _names_to_read("a.csv", header, ["id", "score"], [])


def test_a_hundred_thousand_columns_do_not_hang(tmp_path) -> None:
    path = tmp_path / "wide.csv"
    more = [f"column {'ab'[i % 2] * (i % 7)}{i}" for i in range(100_000)]
    body = [
        f"p{p},{face},{p + len(face)}{',1' * len(more)}" for p in range(3) for face in ("calm", "glad one")
    ]
    path.write_text("\n".join([",".join(["id", "face", "score", *more]), *body]), encoding="utf-8")
    assert len(ratings(path)) == 6
    with pytest.raises(InputError, match="no column 'scorn'") as caught:
        read_long_table(path, "id", "scorn", ["face"])
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        (["2e300", "3e300", "1e300", "2e300"], r"'score' is 3e300 in line 3: .* squares .*\. .*larger unit"),
        (["2e-300", "3e-300", "1e-300", "0"], "every number of 'score' .* below 1e-100: .* smaller unit"),
    ],
)
def test_numbers_whose_squares_no_computer_has_are_refused(tmp_path, numbers, said) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{row.rpartition(',')[0]},{n}" for row, n in zip(TEXT.splitlines()[1:], numbers, strict=True)]
    path.write_text("\n".join(["id,face,score", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        ratings(path)


def test_ratings_around_a_billion_that_differ_are_not_called_the_same() -> None:
    rows = pd.DataFrame(
        {"id": list("aabbcc"), "c": list("xyxyxy"), "r": 1e9 + np.array([0, 0.001, 5, 5, 0.25, 0.5])}
    )
    assert cell_table(rows, "id", "r", ["c"]).constant == ("b",)
    thirds = pd.DataFrame({"id": list("aabb"), "c": list("xyxy"), "r": [0.1 + 0.2, 0.3, 1, 2]})
    assert cell_table(thirds, "id", "r", ["c"]).constant == ("a",)


def written(path, values: list[object]) -> None:
    if path.suffix == ".sav":
        frame = pd.DataFrame({"id": ["a", "b"], "face": ["x", "x"], "score": values})
        pyreadstat.write_sav(frame, path)
        return
    book = openpyxl.Workbook()
    for row in [("id", "face", "score"), ("a", "x", values[0]), ("b", "x", values[1])]:
        book.active.append(row)
    book.save(path)


@pytest.mark.parametrize("name", ["a.xlsx", "a.sav"])
def test_a_number_of_a_workbook_has_one_reading(tmp_path, name) -> None:
    written(tmp_path / name, [1.003, 950])
    assert [row[2] for row in ratings(tmp_path / name)] == [1.003, 950.0]


def test_text_of_a_workbook_may_have_two(tmp_path) -> None:
    written(tmp_path / "a.xlsx", ["1.003", 950])
    with pytest.raises(InputError, match=r"can be read as 1\.003 or as 1003"):
        ratings(tmp_path / "a.xlsx")


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("p1,a,3\n\n\np1,b,4\n\np2,a,x\n", 7),
        ("\r\n\r\np1,a,3\r\np2,a,x\r\n", 5),
        ('p1,"a\nb",3\n\np2,a,x\n', 5),
        ('p1,5" a,3\n\np2,a,x\n', 4),
        ("p1,a,3\n\np2,a,x", 4),
    ],
    ids=["LF", "CR LF", "a cell of two lines", "a quote in a cell", "no newline at the end"],
)
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_lines_are_those_of_an_editor_where_blank_ones_are_skipped(tmp_path, body, line, mark) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(f"{mark}id,face,score\n{body}".encode())
    with pytest.raises(InputError, match=f"got 'x' in line {line};"):
        ratings(path)


def test_lines_stay_true_over_many_blank_ones(tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("id,face,score\n" + "\np1,a,3\n" * 20 + "p2,a,x\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"got 'x' in line 42;"):
        ratings(path)
