from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.ratings import COLUMN_NAMES, RATING_COLUMNS, csv_header, csv_row, factors_in_header


def test_every_column_has_a_sentence_and_a_name_of_its_own() -> None:
    assert len(set(COLUMN_NAMES)) == len(COLUMN_NAMES)
    assert all(column.sentence.endswith(".") for column in RATING_COLUMNS)


def test_jspsych_names_are_kept() -> None:
    assert {"trial_index", "rt", "response", "stimulus", "time_elapsed"} <= set(COLUMN_NAMES)


@settings(deadline=None)
@given(st.lists(st.sampled_from(["character", "lid", "speed"]), unique=True))
def test_factors_are_read_back_from_the_header(factors: list[str]) -> None:
    assert factors_in_header(csv_header(factors)) == factors


def test_a_row_has_a_cell_for_every_header_column() -> None:
    row = dict.fromkeys(COLUMN_NAMES) | {"levels": '{"speed": "fast"}', "synthetic": True, "response": 5}
    header = csv_header(["speed"])
    cells = dict(zip(header, csv_row(list(row.values()), ("speed",)), strict=True))
    assert cells["speed"] == "fast"
    assert (cells["synthetic"], cells["response"], cells["comment"]) == (1, 5, None)
