"""Workbooks and SPSS files as people have them: merged heads, dates, charts, words and missing values."""

from datetime import datetime

import openpyxl
import pandas as pd
import pyreadstat
import pytest

from analysis.models.columns import ModelTerms
from analysis.models.design import model_data
from analysis.pairs.abilities import read_item_factors
from analysis.pairs.comparisons import read_comparisons
from analysis.read.long_csv import LongData, read_long_table
from analysis.read.model_csv import read_model_input
from analysis.thresholds.answers import read_answers
from analysis.thresholds.people import fit_thresholds
from analysis.votes import read_votes
from analysis.within.cell_means import cell_table
from experiments.errors import InputError

HEAD = ("id", "cond", "score")
ROWS = [(f"p{i}", cond, 1 + (2 * i + 3 * k) % 7) for i in range(4) for k, cond in enumerate("abc")]


def read(path) -> LongData:
    return read_long_table(path, "id", "score", ["cond"])


def workbook(path, rows, merged=()):
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    for area in merged:
        book.active.merge_cells(area)
    book.save(path)
    return path


@pytest.mark.parametrize(
    ("rows", "merged", "said"),
    [
        ([("My study", None, None), HEAD, *ROWS], ["A1:C1"], "first row has merged cells (A1:C1)"),
        ([("id", "blur", None), (None, "a", "b"), ("p1", 1, 2)], ["B1:C1"], "its own name (blur_calm)"),
        ([HEAD, ROWS[0], (None, *ROWS[1][1:])], ["A2:A3"], "the cells A2:A3 of 'id' are merged"),
    ],
    ids=["title", "two rows of heads", "ids"],
)
def test_merged_cells_are_named(tmp_path, rows, merged, said) -> None:
    with pytest.raises(InputError) as caught:
        read(workbook(tmp_path / "a.xlsx", rows, merged))
    assert said in str(caught.value)


def test_merged_cells_next_to_what_is_read_are_nothing(tmp_path) -> None:
    rows = [(*HEAD, "note"), *[(*row, "x") for row in ROWS]]
    assert len(read(workbook(tmp_path / "a.xlsx", rows, ["D2:D4"])).rows) == len(ROWS)


def test_empty_rows_above_the_names_are_passed_over_and_lines_stay_true(tmp_path) -> None:
    rows = [(None,), (None,), HEAD, *ROWS]
    assert len(read(workbook(tmp_path / "a.xlsx", rows)).rows) == len(ROWS)
    with pytest.raises(InputError, match="got 'x' in line 4"):
        read(workbook(tmp_path / "b.xlsx", [(None,), (None,), HEAD, ("p0", "a", "x"), *ROWS[1:]]))


def test_dates_among_levels_are_said(tmp_path) -> None:
    rows = [(person, datetime(2026, 5, 1) if cond == "a" else cond, score) for person, cond, score in ROWS]
    data = read(workbook(tmp_path / "a.xlsx", [HEAD, *rows]))
    assert any("'cond' holds dates among other values (2026-05-01 in row 2)" in one for one in data.decisions)


def test_a_workbook_that_openpyxl_stumbles_over_ends_in_one_line(tmp_path) -> None:
    path = tmp_path / "a.xlsx"
    book = openpyxl.Workbook()
    book.active.append(HEAD)
    book.create_chartsheet("chart")
    book.save(path)
    with pytest.raises(InputError, match=r"not an Excel workbook that can be read .*; save it") as caught:
        read(path)
    assert "\n" not in str(caught.value)


def spss(path, words, **more):
    frame = pd.DataFrame([(p, float("abc".index(c) + 1), float(s)) for p, c, s in ROWS], columns=list(HEAD))
    pyreadstat.write_sav(frame, path, variable_value_labels={"cond": words}, **more)
    return read(path)


def test_codes_of_one_word_are_kept_apart(tmp_path) -> None:
    data = spss(tmp_path / "a.sav", {1: "same", 2: "same", 3: "other"})
    assert sorted(data.rows["cond"].unique()) == ["other", "same (1)", "same (2)"]
    assert any("several codes of 'cond' have the same label (same)" in one for one in data.decisions)
    assert sorted(spss(tmp_path / "b.sav", {1: "2", 3: "x"}).rows["cond"].unique()) == ["2 (1)", "2 (2)", "x"]


def test_values_declared_missing_are_not_ratings(tmp_path) -> None:
    ranges = {"score": [{"lo": 6, "hi": 7}, 1]}
    data = spss(tmp_path / "a.sav", {1: "a"}, missing_ranges=ranges)
    left = [score for *_, score in ROWS if score not in (1, 6, 7)]
    assert data.rows["score"].tolist() == left


WORDS = {1: "low", 2: "middle", 3: "high"}


def test_levels_are_in_the_order_of_their_codes(tmp_path) -> None:
    data = spss(tmp_path / "a.sav", WORDS)
    table = cell_table(data.rows, "id", "score", ["cond"])
    assert table.levels == (("low", "middle", "high"),)
    assert table.y[1].tolist() == [score for person, _, score in ROWS if person == "p1"]
    assert any("levels of 'cond' in the order of the codes: low, middle, high" in d for d in data.decisions)


def test_a_mixed_model_takes_the_order_of_the_codes(tmp_path) -> None:
    spss(tmp_path / "a.sav", WORDS)
    rows = read_model_input(tmp_path / "a.sav", "id", "score", ["cond"], []).rows
    assert model_data(rows, ModelTerms("id", "score", ("cond",))).levels == (("low", "middle", "high"),)


def test_order_by_letters_needs_no_word(tmp_path) -> None:
    words = {1: "a", 2: "b", 3: "c"}
    assert not any("order" in said for said in spss(tmp_path / "a.sav", words).decisions)


def answers(path, words):
    """The same people and conditions, each at three steps, with answers that rise."""
    rows = [
        (p, float("abc".index(c) + 1), step, float(step + i // 12 * 2 > 2))
        for i, (p, c, _) in enumerate(ROWS * 2)
        for step in (1.0, 2.0, 3.0)
    ]
    frame = pd.DataFrame(rows, columns=["id", "cond", "x", "yes"])
    pyreadstat.write_sav(frame, path, variable_value_labels={"cond": words})
    return path


def test_thresholds_opinion_and_pairs_take_the_order_of_the_codes(tmp_path) -> None:
    spss(tmp_path / "votes.sav", WORDS)
    votes = read_votes(tmp_path / "votes.sav", "cond", "id", "score")
    assert votes.items == ("low", "middle", "high")
    means = {c: sum(s for _, one, s in ROWS if one == c) / 4 for c in "abc"}
    assert [one.mean() for one in votes.all_votes] == [means[c] for c in "abc"]
    read = read_answers(answers(tmp_path / "t.sav", WORDS), "x", "yes", "id", "cond")
    assert read.conditions() == ("low", "middle", "high")
    assert [said for said in read.decisions if "order" in said] == [
        "levels of 'cond' in the order of the codes: low, middle, high"
    ]
    pairs = pd.DataFrame({"left": [1.0, 2.0, 3.0], "right": [2.0, 3.0, 1.0], "winner": ["left"] * 3})
    both = {"left": WORDS, "right": WORDS}
    pyreadstat.write_sav(pairs, tmp_path / "pairs.sav", variable_value_labels=both)
    assert read_comparisons(tmp_path / "pairs.sav", "left", "right", "winner").items == (
        "low",
        "middle",
        "high",
    )


def test_fits_of_thresholds_are_in_the_order_of_the_codes(tmp_path) -> None:
    read = read_answers(answers(tmp_path / "t.sav", WORDS), "x", "yes", None, "cond")
    fits = fit_thresholds(read, "logistic", 0.0, 0.02)
    assert list(fits.pooled) == ["low", "middle", "high"]


def test_factors_of_items_take_the_order_of_the_codes(tmp_path) -> None:
    frame = pd.DataFrame({"item": ["p", "q", "r"], "size": [3.0, 1.0, 2.0]})
    pyreadstat.write_sav(frame, tmp_path / "f.sav", variable_value_labels={"size": WORDS})
    assert read_item_factors(tmp_path / "f.sav").names("size") == ("low", "middle", "high")


def test_people_with_words_for_their_codes_are_not_listed(tmp_path) -> None:
    people = {1: "zoe", 2: "adam"}
    frame = pd.DataFrame({"id": [1.0, 1.0, 2.0, 2.0], "cond": ["a", "b"] * 2, "score": [1.0, 2.0, 3.0, 5.0]})
    pyreadstat.write_sav(frame, tmp_path / "a.sav", variable_value_labels={"id": people})
    data = read(tmp_path / "a.sav")
    assert sorted(data.rows["id"].unique()) == ["adam", "zoe"]
    assert not any("order of the codes" in said for said in data.decisions)
