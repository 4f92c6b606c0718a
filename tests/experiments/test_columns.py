import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.columns import RUN_COLUMNS, Column, names_of
from experiments.kinds import views
from experiments.kinds.clip_rating import RATINGS


@pytest.mark.parametrize("columns", [RUN_COLUMNS, *(view.columns for view in views())])
def test_every_column_has_a_sentence_and_a_name_of_its_own(columns: tuple[Column, ...]) -> None:
    assert len(set(names_of(columns))) == len(columns)
    assert all(column.description.endswith(".") for column in columns)


def test_a_range_admits_what_lies_in_it() -> None:
    play = RATINGS.pick("play")[0]
    assert [play.admits(value) for value in (None, 0, 1, 7)] == [True, False, True, True]
    verdict = RATINGS.pick("verdict")[0]
    assert [verdict.admits(value) for value in ("good", "fine")] == [True, False]
    with pytest.raises(KeyError, match="verdikt"):
        RATINGS.pick("verdikt")


def test_jspsych_names_are_kept() -> None:
    assert {"trial_index", "rt", "response", "stimulus", "time_elapsed"} <= set(RATINGS.names)


@settings(deadline=None)
@given(st.lists(st.sampled_from(["character", "lid", "speed"]), unique=True))
def test_factors_are_read_back_from_the_header(factors: list[str]) -> None:
    assert RATINGS.factors_in_header(RATINGS.csv_header(factors)) == factors


def test_a_row_has_a_cell_for_every_header_column() -> None:
    row = dict.fromkeys(RATINGS.names) | {"levels": '{"speed": "fast"}', "synthetic": True, "response": 5}
    header = RATINGS.csv_header(["speed"])
    cells = dict(zip(header, RATINGS.csv_row(list(row.values()), ("speed",)), strict=True))
    assert cells["speed"] == "fast"
    assert (cells["synthetic"], cells["response"], cells["comment"]) == (1, 5, None)
