"""Rows that are in a file twice are named, by every command that reads rows."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.wide import CHANCE_MAX, copied_block

RNG = np.random.default_rng(27)


def ratings() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    rows = [(f"p{p}", f"c{c}", "ab"[c % 2], int(rng.integers(1, 8))) for p in range(10) for c in range(8)]
    return pd.DataFrame(rows, columns=["id", "clip", "cond", "y"])


def trials() -> pd.DataFrame:
    rng = np.random.default_rng(2)
    x = np.round(rng.uniform(-3, 3, 120), 3)
    return pd.DataFrame({"x": x, "response": (x + rng.normal(size=120) > 0).astype(int)})


def comparisons() -> pd.DataFrame:
    rng = np.random.default_rng(3)
    rows = [
        (f"p{p}", f"v{i}", f"v{j}", f"v{rng.choice([i, j])}")
        for p in range(8)
        for i in range(5)
        for j in range(i)
    ]
    return pd.DataFrame(rows, columns=["participant", "left", "right", "winner"])


COMMANDS = {
    "mixed": (ratings, "mixed F --participant id --rating y --within cond --item clip"),
    "ordinal": (ratings, "ordinal F --participant id --rating y --within cond"),
    "anova": (ratings, "anova F --participant id --rating y --within cond"),
    "opinion": (ratings, "opinion F --item clip --participant id --rating y"),
    "agreement": (ratings, "agreement F --item clip --participant id --rating y"),
    "thresholds": (trials, "thresholds F --x x --response response"),
    "pairs": (comparisons, "pairs F"),
}


def said(command: str, rows: pd.DataFrame, folder: Path) -> str:
    file = folder / "rows.csv"
    rows.to_csv(file, index=False)
    done = CliRunner().invoke(app, COMMANDS[command][1].replace("F", str(file), 1).split())
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_pasted_twice_is_named_by_each_command(command: str, tmp_path: Path) -> None:
    rows = COMMANDS[command][0]()
    n = len(rows)
    assert "pasted twice" not in said(command, rows, tmp_path)
    output = said(command, pd.concat([rows, rows]), tmp_path)
    assert f"ines {n + 2} to {2 * n + 1} are exact copies of lines 2 to {n + 1} ({n} rows)" in output


def test_copies_of_a_part_and_of_sorted_rows_are_named(tmp_path: Path) -> None:
    rows = ratings()
    part = pd.concat([rows, rows.iloc[24:40]])
    assert "lines 82 to 97 are exact copies of lines 26 to 41" in said("mixed", part, tmp_path)
    in_between = pd.concat([rows.iloc[:40], rows.iloc[8:16], rows.iloc[40:]])
    assert "lines 42 to 49 are exact copies of lines 10 to 17" in said("mixed", in_between, tmp_path)
    sorted_rows = pd.concat([rows, rows]).sort_values(["id", "clip"])
    assert "every row is in the table twice" in said("mixed", sorted_rows, tmp_path)


def test_rows_that_differ_in_any_column_are_not_copies(tmp_path: Path) -> None:
    rows = ratings()
    twice = pd.concat([rows.assign(session=1), rows.assign(session=2)])
    assert "pasted twice" not in said("mixed", twice, tmp_path)


@pytest.mark.parametrize("seed", range(20))
def test_ratings_that_agree_by_chance_are_not_copies(seed: int) -> None:
    """Fixed orders of conditions, few levels, no trial numbers: what repeats there is no copied file."""
    rng = np.random.default_rng(seed)
    levels = int(rng.integers(2, 8))
    x = np.tile(np.arange(levels), 60)
    trials_of = pd.DataFrame({"x": x, "y": (x + rng.normal(0, 1.5, len(x)) > levels / 2).astype(int)})
    assert copied_block(trials_of) is None
    people = pd.DataFrame({"p": np.repeat(np.arange(15), 24), "c": np.tile(["a", "b", "c"], 120)})
    people["y"] = rng.integers(1, 6, len(people))
    assert copied_block(people) is None
    many = pd.DataFrame({"p": np.repeat(np.arange(300), 200), "c": np.tile(["a", "b", "c", "d"], 15_000)})
    many["y"] = rng.integers(1, 6, len(many))
    assert copied_block(many) is None
    thrice = pd.concat([many[:200]] * 3)
    block = copied_block(thrice)
    assert block is not None
    assert (block.first, block.original, block.length) == (200, 0, 200)


def random_table(rng: np.random.Generator) -> pd.DataFrame:
    """Ratings of an experiment of any size: consistent people or not, fixed orders or not, named or not."""
    people, conditions, rounds, scale = (int(rng.integers(low, high)) for low, high in SIZES)
    is_fixed, is_named, noise = rng.random() < 0.5, rng.random() < 0.6, rng.choice([0.3, 0.7, 1.5, 9.0])
    effects = rng.normal(0, 1.5, conditions)
    rows = []
    for person in range(people):
        own = rng.normal()
        for _ in range(rounds):
            for condition in np.arange(conditions) if is_fixed else rng.permutation(conditions):
                rating = round((scale + 1) / 2 + own + effects[condition] + rng.normal(0, noise))
                rows.append((person * is_named, condition, min(max(rating, 1), scale)))
    return pd.DataFrame(rows, columns=["person", "condition", "rating"])


SIZES = ((1, 13), (1, 9), (1, 9), (2, 8))
"""Least and beyond most people, conditions, rounds and steps of the scale."""


def test_of_two_thousand_random_tables_none_has_a_copy() -> None:
    """With a chance below one in a million for each; one in 250 had one by the rule of before."""
    rng = np.random.default_rng(49)
    assert [number for number in range(2_000) if copied_block(random_table(rng)) is not None] == []


def test_copies_in_random_tables_are_found_with_the_chance_that_is_stated() -> None:
    rng = np.random.default_rng(50)
    found = 0
    for _ in range(200):
        rows = random_table(rng)
        part = rows.iloc[: max(40, len(rows) // 2)]
        block = copied_block(pd.concat([rows, part]))
        assert block is None or block.chance < CHANCE_MAX
        found += block is not None and block.length >= len(part) - 2
    assert found >= 100, found
