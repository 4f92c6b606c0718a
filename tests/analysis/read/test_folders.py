"""Folders of tables, JSON lines and hidden rows: as programs and people leave them."""

import csv
import json
from pathlib import Path

import openpyxl
import pandas as pd
import pyreadstat
import pytest

from analysis.read.long_csv import read_long_table
from analysis.read.wide import lengthen
from experiments.errors import InputError

PEOPLE = ("p1", "p2", "p3")


def folder_of(folder: Path, psychopy: bool = False) -> Path:
    """A folder with one file per person, without a column of people."""
    folder.mkdir()
    for number, person in enumerate(PEOPLE):
        rows = [f"calm,{number + 1}", f"wild,{number + 3}"]
        head = "face,score"
        if psychopy:
            head, rows = f"{head},psychopyVersion", [",,2025.1", *(f"{row},2025.1" for row in rows)]
        (folder / f"{person}.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("psychopy", [False, True], ids=["plain", "PsychoPy"])
def test_a_folder_with_a_file_a_person_is_one_table(tmp_path, psychopy) -> None:
    data = read_long_table(folder_of(tmp_path / "f", psychopy), "file", "score", ["face"])
    assert data.rows["file"].astype(str).tolist() == [person for person in PEOPLE for _ in range(2)]
    assert data.rows["score"].tolist() == [1, 3, 2, 4, 3, 5]
    assert data.decisions[0] == "read 3 data files of the folder f"


def test_a_column_that_a_folder_lacks_is_reported_with_the_folder(tmp_path, monkeypatch) -> None:
    folder = folder_of(tmp_path / "f")
    told = r"^the folder f \(all its \.csv files as one table\) has no column 'rating'"
    with pytest.raises(InputError, match=told):
        read_long_table(folder, "file", "rating", ["face"])
    monkeypatch.chdir(folder)
    with pytest.raises(InputError, match=told):
        read_long_table(Path(), "file", "rating", ["face"])


def test_broken_runs_and_copies_in_a_folder_are_named(tmp_path) -> None:
    folder = folder_of(tmp_path / "f")
    (folder / "p8.csv").write_text("", encoding="utf-8")
    (folder / "p9.csv").write_text("face,score\n\n", encoding="utf-8")
    (folder / "p3 (1).csv").write_bytes((folder / "p3.csv").read_bytes())
    data = read_long_table(folder, "file", "score", ["face"])
    assert list(data.decisions[1:3]) == [
        "files without rows ignored: p8.csv, p9.csv",
        "files that are identical to another file were also counted: p3.csv",
    ]


def test_a_file_into_which_the_others_were_joined_is_refused(tmp_path) -> None:
    folder = folder_of(tmp_path / "f")
    rows = [line for path in sorted(folder.iterdir()) for line in path.read_text().splitlines()[1:]]
    (folder / "all.csv").write_text("\n".join(["face,score", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"every row of 3 files \(p1.csv, p2.csv, p3.csv\) is also in all.csv"
    ):
        read_long_table(folder, "file", "score", ["face"])


def people_file(folder: Path, person: str, seed: int, trials: int = 12) -> pd.DataFrame:
    """A person's file of `trials` answers; the table it holds."""
    folder.mkdir(exist_ok=True)
    faces, scores = ["calm", "wild"] * (trials // 2), [1 + (seed * k * k + k) % 7 for k in range(trials)]
    table = pd.DataFrame(
        {"face": faces, "score": scores, "rt": [400 + 37 * seed + 11 * k for k in range(trials)]}
    )
    table.to_csv(folder / f"{person}.csv", index=False)
    return table


def joined_by_pandas(tables: list[pd.DataFrame], path: Path) -> None:
    pd.concat([table.assign(id=i) for i, table in enumerate(tables)], ignore_index=True).to_csv(path)


def joined_by_r(tables: list[pd.DataFrame], path: Path) -> None:
    """As `write.csv2` has it: quoted texts, semicolons, decimal commas, columns in the order of the names."""
    joined = pd.concat(tables)[["score", "rt", "face"]].astype({"score": float})
    joined.to_csv(path, sep=";", decimal=",", quoting=csv.QUOTE_NONNUMERIC)


@pytest.mark.parametrize("join", [joined_by_pandas, joined_by_r])
@pytest.mark.parametrize(
    "beside", ["nothing", "a copy", "blank lines", "a longer file", "the joined file twice"]
)
def test_a_joined_file_is_known_by_its_cells(tmp_path, join, beside) -> None:
    folder = tmp_path / "f"
    tables = [people_file(folder, person, seed) for seed, person in enumerate(PEOPLE, 1)]
    join(tables, folder / "all.csv")
    if beside == "a copy":
        (folder / "p3 (1).csv").write_bytes((folder / "p3.csv").read_bytes())
    if beside == "blank lines":
        with (folder / "p2.csv").open("a", encoding="utf-8") as file:
            file.write("\n\n,,\n")
    if beside == "a longer file":
        people_file(folder, "p9", 9, 60)
    if beside == "the joined file twice":
        (folder / "all2.csv").write_bytes((folder / "all.csv").read_bytes())
    with pytest.raises(InputError, match=r"every row of 3 files .* is also in all2?.csv"):
        read_long_table(folder, "file", "score", ["face"])


def test_rows_of_few_kinds_that_are_those_of_others_are_said_and_count(tmp_path) -> None:
    (tmp_path / "f").mkdir()
    for number, times in enumerate([2, 2, 4]):
        rows = ["calm,1", "wild,2"] * times
        (tmp_path / "f" / f"p{number}.csv").write_text("\n".join(["face,score", *rows]), encoding="utf-8")
    data = read_long_table(tmp_path / "f", "file", "score", ["face"])
    assert len(data.rows) == 16
    assert any(
        said.startswith("every row of 2 files (p0.csv, p1.csv) is also in p2.csv, by chance")
        for said in data.decisions
    )


def test_generated_rows_are_reported_though_only_some_files_say_so(tmp_path) -> None:
    folder = folder_of(tmp_path / "f")
    (folder / "p9.csv").write_text("face,score,synthetic,age\ncalm,1,1,30\nwild,2,1,30\n", encoding="utf-8")
    data = read_long_table(folder, "file", "score", ["face"])
    assert data.synthetic
    assert (
        "only some files have a column 'synthetic'; rows of the others are treated as given by people"
        in data.decisions
    )
    assert "columns that only some files have were ignored: age" in data.decisions


def test_hidden_files_and_folders_with_the_name_of_a_table_are_none(tmp_path) -> None:
    folder = folder_of(tmp_path / "f")
    (folder / "old.csv").mkdir()
    (folder / "._p1.csv").write_bytes(b"\0\5\x16\7\0\2\0\0Mac OS X")
    data = read_long_table(folder, "file", "score", ["face"])
    assert data.decisions[0] == "read 3 data files of the folder f"


@pytest.mark.parametrize(
    "text",
    ["face,score\n".encode("utf-16"), b'face,"sc\nore"\n', b"\xef\xbb\xbfface,score\n", b"face,score\n,\n"],
    ids=["UTF-16", "two lines", "mark", "blank cells"],
)
def test_a_header_alone_is_not_a_row_however_it_is_written(tmp_path, text) -> None:
    folder = folder_of(tmp_path / "f")
    (folder / "p9.csv").write_bytes(text)
    data = read_long_table(folder, "file", "score", ["face"])
    assert data.decisions[1] == "files without rows ignored: p9.csv"


def psych_ds_of(folder: Path, named: str) -> None:
    """A Psych-DS folder of two rows per person, in files called as `named` says."""
    (folder / "data").mkdir()
    (folder / "dataset_description.json").write_text("{}", encoding="utf-8")
    for person in PEOPLE:
        text = f"id,face,score\n{person},calm,1\n{person},wild,2\n"
        (folder / "data" / named.format(person)).write_text(text, encoding="utf-8")


def test_psych_ds_files_of_a_header_alone_are_left_out(tmp_path) -> None:
    psych_ds_of(tmp_path, "id-{}_data.csv")
    (tmp_path / "data" / "id-p9_data.csv").write_bytes("id,face,score\n".encode("utf-16"))
    data = read_long_table(tmp_path, "id", "score", ["face"])
    assert set(data.rows["id"].astype(str)) == set(PEOPLE)


def test_messages_name_the_file_next_to_the_line(tmp_path) -> None:
    folder = folder_of(tmp_path / "f")
    with (folder / "p2.csv").open("a", encoding="utf-8") as file:
        file.write("calm,\n")
    data = read_long_table(folder, "file", "score", ["face"])
    assert "1 row without a rating excluded (line 4 of p2.csv)" in data.decisions
    (folder / "p3.csv").write_text("face,score\ncalm,1\nwild,many\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line 3 of p3\.csv"):
        read_long_table(folder, "file", "score", ["face"])


def test_answers_of_few_kinds_that_are_alike_by_chance_are_not_a_joined_file(tmp_path) -> None:
    (tmp_path / "f").mkdir()
    for number in range(5):
        rows = ["calm,1", "wild,2"] * (4 if number == 2 else 3)
        (tmp_path / "f" / f"p{number}.csv").write_text("\n".join(["face,score", *rows]), encoding="utf-8")
    assert len(read_long_table(tmp_path / "f", "file", "score", ["face"]).rows) == 32


def test_a_folder_without_tables_ends_in_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match=r"folder without data files; expected .csv files, one per person"):
        read_long_table(tmp_path, "file", "score", ["face"])


def test_a_column_counts_and_not_the_name_of_the_file(tmp_path) -> None:
    psych_ds_of(tmp_path, "id-x{}_data.csv")
    data = read_long_table(tmp_path, "id", "score", ["face"])
    assert set(data.rows["id"].astype(str)) == set(PEOPLE)
    assert data.decisions[1] == ("'id' is p1 in id-xp1_data.csv; the column was used, not the file name")


@pytest.mark.parametrize(("name", "lists"), [("jatos.json", True), ("lines.jsonl", False)])
def test_lines_of_json_are_trials(tmp_path, name, lists) -> None:
    trials = [[{"id": p, "face": f, "score": s} for s, f in enumerate(("calm", "wild"), 1)] for p in PEOPLE]
    lines = trials if lists else [trial for person in trials for trial in person]
    (tmp_path / name).write_text("\n".join(json.dumps(line) for line in lines), encoding="utf-8")
    assert len(read_long_table(tmp_path / name, "id", "score", ["face"]).rows) == 6


@pytest.mark.parametrize("name", ["lines.jsonl", "jatos.txt"])
@pytest.mark.parametrize("cut", ["\u2028", "\u0085", "\v"])
def test_lines_of_json_end_in_line_feeds_alone(tmp_path, name, cut) -> None:
    trials = [{"id": p, "face": f, "score": 1, "said": f"a{cut}b"} for p in PEOPLE for f in ("calm", "wild")]
    text = "\r\n".join(json.dumps(trial, ensure_ascii=False) for trial in trials)
    (tmp_path / name).write_text(text, encoding="utf-8", newline="")
    if cut == "\v":  # which JSON writes as an escape
        assert "\\u000b" in text
    assert len(read_long_table(tmp_path / name, "id", "score", ["face"]).rows) == 6


@pytest.mark.parametrize("name", ["one.jsonl", "one.txt"])
def test_one_line_of_json_is_one_trial(tmp_path, name) -> None:
    (tmp_path / name).write_text('{"id": "p1", "face": "calm", "score": 3}\n', encoding="utf-8")
    assert read_long_table(tmp_path / name, "id", "score", ["face"]).rows["score"].tolist() == [3]


def test_a_text_that_begins_with_a_bracket_is_a_table_still(tmp_path) -> None:
    (tmp_path / "t.txt").write_text("[id]\tface\tscore\np1\tcalm\t3\n", encoding="utf-8")
    assert len(read_long_table(tmp_path / "t.txt", "[id]", "score", ["face"]).rows) == 1


def test_one_hidden_row_is_said_in_the_singular(tmp_path) -> None:
    book = openpyxl.Workbook()
    for row in [("id", "face", "score"), *((p, f, 3) for p in PEOPLE for f in ("calm", "wild"))]:
        book.active.append(row)
    book.active.row_dimensions[3].hidden = True
    book.save(tmp_path / "b.xlsx")
    data = read_long_table(tmp_path / "b.xlsx", "id", "score", ["face"])
    assert data.decisions[1] == "1 hidden row of the sheet counts too; delete it where it should not"


def test_rows_that_a_filter_hides_count_and_are_said(tmp_path) -> None:
    book = openpyxl.Workbook()
    for row in [("id", "face", "score"), *((p, f, 3) for p in PEOPLE for f in ("calm", "wild"))]:
        book.active.append(row)
    for number in (3, 4, 5000):
        book.active.row_dimensions[number].hidden = True
    book.save(tmp_path / "b.xlsx")
    data = read_long_table(tmp_path / "b.xlsx", "id", "score", ["face"])
    assert len(data.rows) == 6
    assert data.decisions[1] == "2 hidden rows of the sheet count too; delete them where they should not"


def test_words_of_codes_stay_where_a_wide_spss_file_is_made_long(tmp_path) -> None:
    frame = pd.DataFrame({"id": [1.0, 2.0], "group": [1.0, 2.0], "a_x": [3.0, 4.0], "a_y": [5.0, 6.0]})
    pyreadstat.write_sav(
        frame, tmp_path / "w.sav", variable_value_labels={"group": {1: "young", 2: "old"}, "a_x": {3: "bad"}}
    )
    table = lengthen(tmp_path / "w.sav", "a_{face}", "score")
    assert table.rows["group"].tolist() == ["young", "young", "old", "old"]
    assert table.rows["score"].tolist() == ["3", "5", "4", "6"]


def test_a_level_declared_missing_is_named_so(tmp_path) -> None:
    frame = pd.DataFrame({"id": ["1", "1"], "face": ["calm", "wild"], "score": [1.0, 2.0]})
    pyreadstat.write_sav(frame, tmp_path / "m.sav", missing_ranges={"face": ["wild"]})
    with pytest.raises(InputError, match="'face' is empty, or declared missing, in line 2"):
        read_long_table(tmp_path / "m.sav", "id", "score", ["face"])
