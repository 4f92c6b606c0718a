"""Cell means: dropped participants by name, uneven counts, orders, and misuse."""

import numpy as np
import pandas as pd
import pytest

from analysis.plans.result import cell_decisions
from analysis.within.cell_means import cell_table
from analysis.within.level_codes import natural_order
from experiments.errors import InputError


def rows(text: str) -> pd.DataFrame:
    """Rows from lines of `who A B rating`."""
    table = [line.split() for line in text.strip().splitlines()]
    frame = pd.DataFrame(table, columns=["who", "A", "B", "y"])
    return frame.assign(y=frame["y"].astype(float))


FULL = "p1 a x 1\np1 a y 2\np1 b x 3\np1 b y 4\np2 a x 2\np2 a y 2\np2 b x 2\np2 b y 2"


def test_means_have_participants_first_and_factors_in_order() -> None:
    table = cell_table(rows(FULL), "who", "y", ["B", "A"])
    assert table.participants == ("p1", "p2")
    assert table.y[0].tolist() == [[1, 3], [2, 4]]
    assert table.levels == (("x", "y"), ("a", "b"))


def test_trials_of_a_cell_are_averaged_without_weights_and_uneven_counts_are_said() -> None:
    table = cell_table(rows(FULL + "\np1 a x 4"), "who", "y", ["A"])
    assert table.y[0, 0] == pytest.approx((1 + 2 + 4) / 3)
    assert table.counts[0].tolist() == [3, 2]
    assert "cells have 2 to 3 ratings; all cell means have equal weight" in cell_decisions(table)


def test_a_participant_with_an_empty_cell_is_dropped_by_name() -> None:
    table = cell_table(rows(FULL + "\np3 a x 4\np3 b y 4"), "who", "y", ["A", "B"])
    assert table.participants == ("p1", "p2")
    assert table.dropped[0].participant == "p3"
    assert table.dropped[0].missing_cells == ({"A": "a", "B": "y"}, {"A": "b", "B": "x"})
    assert "participant p3 excluded: no rating in A=a B=y; A=b B=x" in cell_decisions(table)


def test_constant_ratings_are_kept_and_flagged() -> None:
    table = cell_table(rows(FULL), "who", "y", ["A", "B"])
    assert table.constant == ("p2",)
    assert any("p2 gave the same rating" in text for text in cell_decisions(table))


def test_the_order_of_rows_changes_nothing() -> None:
    frame = rows(FULL + "\np1 a x 4")
    turned = frame.sample(frac=1, random_state=3)
    one, other = (cell_table(f, "who", "y", ["A", "B"]) for f in (frame, turned))
    assert one.levels == other.levels
    assert np.array_equal(one.y, other.y)


def test_declared_levels_give_the_order_and_unknown_ones_are_refused() -> None:
    table = cell_table(rows(FULL), "who", "y", ["A"], {"A": ["b", "a"]})
    assert table.levels == (("b", "a"),)
    with pytest.raises(InputError, match="'b' is not a level of 'A'; did you mean 'bb'"):
        cell_table(rows(FULL), "who", "y", ["A"], {"A": ["a", "bb"]})


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (["13", "7", "11", "9"], ["7", "9", "11", "13"]),
        (["010", "9", "10"], ["9", "010", "10"]),
        (["b", "A", "nan"], ["A", "b", "nan"]),
        (["-1", "2.5", "0"], ["-1", "0", "2.5"]),
    ],
)
def test_natural_order(names, order) -> None:
    assert natural_order(names) == order


def test_a_cell_nobody_rated_and_a_table_without_complete_participants_are_refused() -> None:
    with pytest.raises(InputError, match="nobody rated A=b B=y"):
        cell_table(rows("p1 a x 1\np1 a y 1\np1 b x 1\np2 a x 1\np2 a y 1"), "who", "y", ["A", "B"])
    half = "p1 a x 1\np1 b y 1\np2 a y 1\np2 b x 1"
    with pytest.raises(InputError, match="no participant has a rating in every cell"):
        cell_table(rows(half), "who", "y", ["A", "B"])
    with pytest.raises(InputError, match="levels 'X' and 'x' of B differ only in case; remove a factor"):
        cell_table(rows(half.replace("b x", "b X").replace("b y", "a X")), "who", "y", ["B"])


def test_a_factor_between_participants_is_called_so() -> None:
    with pytest.raises(InputError, match=r"'A' never varies within a participant.*--between A"):
        cell_table(rows("p1 a x 1\np1 a y 2\np2 b x 1"), "who", "y", ["A"])


@pytest.mark.parametrize(
    ("names", "message"),
    [(("wo", "y", ["A"]), "no column is called 'wo'; did you mean 'who'"), (("who", "y", ["C"]), "'C'")],
)
def test_unknown_columns_are_named(names, message) -> None:
    with pytest.raises(InputError, match=message):
        cell_table(rows(FULL), *names)


def test_an_empty_table_is_refused() -> None:
    with pytest.raises(InputError, match="no ratings"):
        cell_table(rows(FULL)[:0], "who", "y", ["A"])
