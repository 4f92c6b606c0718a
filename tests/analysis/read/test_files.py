"""The same ratings in every sort of file give the same rows; what cannot be read ends in one line."""

import csv
import json
from datetime import date
from pathlib import Path

import openpyxl
import pandas as pd
import pyreadstat
import pytest

from analysis.read.long_csv import read_long_table
from experiments.errors import InputError

ROWS = [(f"0{i}", face, 1 + (2 * i + 3 * k) % 7) for i in range(4) for k, face in enumerate(("calm", "Ärm"))]


def rows_of(path: Path) -> list[tuple[str, str, float]]:
    data = read_long_table(path, "id", "score", ["face"])
    return list(data.rows[["id", "face", "score"]].astype({"id": str, "face": str}).itertuples(index=False))


def workbook(path: Path, rows=ROWS, others=()) -> Path:
    book = openpyxl.Workbook()
    book.active.title = "ratings"
    for row in [("id", "face", "score"), *rows]:
        book.active.append(row)
    for title in others:
        book.create_sheet(title).append(["something"])
    book.save(path)
    return path


def spss(path: Path) -> Path:
    frame = pd.DataFrame(
        {
            "id": [row[0] for row in ROWS],
            "face": [1.0 if row[1] == "calm" else 2.0 for row in ROWS],
            "score": [float(row[2]) for row in ROWS],
        }
    )
    labels = {"face": {1: "calm", 2: "Ärm"}, "score": {1: "bad", 7: "good"}}
    pyreadstat.write_sav(frame, path, variable_value_labels=labels)
    return path


def jspsych(path: Path) -> Path:
    trials = []
    for i, (person, face, score) in enumerate(ROWS):
        beside = {"id": person, "trial_index": 2 * i, "time_elapsed": 900 * i, "rt": None}
        trials.append({**beside, "trial_type": "html-keyboard-response", "response": None})
        trials.append({**beside, "trial_type": "html-slider-response", "face": face, "score": score})
    path.write_text(json.dumps(trials), encoding="utf-8")
    return path


def psych_ds(folder: Path) -> Path:
    (folder / "data").mkdir(parents=True)
    (folder / "dataset_description.json").write_text("{}", encoding="utf-8")
    for person in dict.fromkeys(row[0] for row in ROWS):
        lines = ["face,score", *(f"{row[1]},{row[2]}" for row in ROWS if row[0] == person)]
        (folder / "data" / f"study-one_id-{person}_data.csv").write_text("\n".join(lines), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("make", "name"),
    [(workbook, "b.xlsx"), (spss, "b.sav"), (jspsych, "b.json"), (psych_ds, "b")],
    ids=["Excel", "SPSS", "jsPsych", "Psych-DS"],
)
def test_every_sort_of_file_holds_the_same_ratings(tmp_path, make, name) -> None:
    assert rows_of(make(tmp_path / name)) == [(i, face, float(score)) for i, face, score in ROWS]


def test_what_was_understood_of_an_export_is_said_first(tmp_path) -> None:
    data = read_long_table(jspsych(tmp_path / "b.json"), "id", "score", ["face"])
    assert data.decisions[0] == (
        "read as data of jsPsych: 8 rows without 'id' and 'score' and 'face' excluded "
        "(html-keyboard-response 8)"
    )


@pytest.mark.parametrize("ending", ["json", "csv"])
def test_a_survey_of_one_question_is_its_number(tmp_path, ending) -> None:
    trials = json.loads(jspsych(tmp_path / "b.json").read_text(encoding="utf-8"))
    for trial in trials[1::2]:
        trial |= {"trial_type": "survey-likert", "response": {"Q0": trial["score"]}}
    path = tmp_path / f"survey.{ending}"
    if ending == "json":
        path.write_text(json.dumps(trials), encoding="utf-8")
    else:
        texts = [one | {"response": json.dumps(one["response"], separators=(",", ":"))} for one in trials]
        pd.DataFrame(texts).to_csv(path, index=False)
    data = read_long_table(path, "id", "response", ["face"])
    assert data.rows["response"].tolist() == [float(row[2]) for row in ROWS]
    assert "jsPsych numbers their choices from 0" in data.decisions[1]


def test_a_survey_of_several_questions_is_not_a_number(tmp_path) -> None:
    path = tmp_path / "two.json"
    beside = {"trial_type": "survey-likert", "trial_index": 1, "time_elapsed": 9, "id": "a", "face": "calm"}
    path.write_text(json.dumps([beside | {"response": {"Q0": 1, "Q1": 2}}]), encoding="utf-8")
    with pytest.raises(InputError, match="'response' should be a number"):
        read_long_table(path, "id", "response", ["face"])


def test_the_last_line_of_gorilla_is_not_a_trial(tmp_path) -> None:
    path = tmp_path / "gorilla.csv"
    lines = ["Event Index,Participant Private ID,Zone Type,face,Response"]
    lines += [f"{i},{p},response_slider,{f},{s}" for i, (p, f, s) in enumerate(ROWS)]
    path.write_text("\n".join([*lines, "END OF FILE,,,,"]), encoding="utf-8")
    data = read_long_table(path, "Participant Private ID", "Response", ["face"])
    assert len(data.rows) == len(ROWS)
    assert "read as data of Gorilla: 1 row" in data.decisions[0]


def test_routines_of_psychopy_without_a_rating_are_not_trials(tmp_path) -> None:
    path = tmp_path / "psychopy.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(["participant", "face", "slider.response", "expName", "psychopyVersion"])
        for person, face, score in ROWS:
            out.writerow([person, "", "", "faces", "2025.1.1"])
            out.writerow([person, face, score, "faces", "2025.1.1"])
    assert len(read_long_table(path, "participant", "slider.response", ["face"]).rows) == len(ROWS)


def test_two_sheets_are_refused_until_one_is_named(tmp_path) -> None:
    path = workbook(tmp_path / "b.xlsx", others=["notes"])
    with pytest.raises(
        InputError, match=r"2 sheets with cells \(ratings, notes\); name one: 'b.xlsx#ratings'"
    ):
        rows_of(path)
    assert len(rows_of(tmp_path / "b.xlsx#ratings")) == len(ROWS)
    with pytest.raises(InputError, match="no sheet 'rating'; did you mean 'ratings'"):
        rows_of(tmp_path / "b.xlsx#rating")


@pytest.mark.parametrize(
    ("score", "said"),
    [
        (date(2026, 3, 4), "'score' should be a number, got '2026-03-04' in line 3"),
        ("#DIV/0!", "'score' should be a number, got '#DIV/0!' in line 3"),
        ("=1+1", "row 3 of 'score' holds the formula =1.1 without its value"),
        (True, "'score' should be a number, got 'True' in line 3"),
    ],
)
def test_cells_that_are_not_ratings_are_refused(tmp_path, score, said) -> None:
    rows = [*ROWS]
    rows[1] = (*rows[1][:2], score)
    with pytest.raises(InputError, match=said):
        rows_of(workbook(tmp_path / "b.xlsx", rows))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.xlsx", "no zip", "is not an Excel workbook that can be read"),
        ("a.sav", "no spss", "is not an SPSS file"),
        ("a.json", "{", "is not JSON"),
        ("a.json", f'[{{"x": {"9" * 5000}}}]', "is not JSON that can be read"),
        ("a.json", "[1, 2]", "expected a list of objects, one per trial"),
        ("a.ods", "x", "files of .ods are not read; save it as .xlsx"),
    ],
)
def test_files_of_another_sort_end_in_one_line(tmp_path, name, text, said) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        rows_of(tmp_path / name)
    assert "\n" not in str(caught.value)
