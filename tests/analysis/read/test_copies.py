"""Rows that are in a file twice are named, by every command that reads rows."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.read.wide import copied_block, row_codes

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
    assert f"lines {n + 2} to {2 * n + 1} are exact copies of lines 2 to {n + 1} ({n} rows)" in output


def test_copies_of_a_part_and_of_sorted_rows_are_named(tmp_path: Path) -> None:
    rows = ratings()
    part = pd.concat([rows, rows.iloc[24:40]])
    assert "lines 82 to 97 are exact copies of lines 26 to 41" in said("mixed", part, tmp_path)
    in_between = pd.concat([rows.iloc[:40], rows.iloc[8:16], rows.iloc[40:]])
    assert "lines 42 to 49 are exact copies of lines 10 to 17" in said("mixed", in_between, tmp_path)
    sorted_rows = pd.concat([rows, rows]).sort_values(["id", "clip"])
    assert "every row is in the table twice" in said("mixed", sorted_rows, tmp_path)


def test_rows_that_differ_in_any_column_are_no_copies(tmp_path: Path) -> None:
    rows = ratings()
    twice = pd.concat([rows.assign(session=1), rows.assign(session=2)])
    assert "pasted twice" not in said("mixed", twice, tmp_path)


@pytest.mark.parametrize("seed", range(20))
def test_ratings_that_agree_by_chance_are_no_copies(seed: int) -> None:
    """Fixed orders of conditions, few levels, no trial numbers: what repeats there is no copied file."""
    rng = np.random.default_rng(seed)
    levels = int(rng.integers(2, 8))
    x = np.tile(np.arange(levels), 60)
    trials_of = pd.DataFrame({"x": x, "y": (x + rng.normal(0, 1.5, len(x)) > levels / 2).astype(int)})
    assert copied_block(row_codes(trials_of)) is None
    people = pd.DataFrame({"p": np.repeat(np.arange(15), 24), "c": np.tile(["a", "b", "c"], 120)})
    people["y"] = rng.integers(1, 6, len(people))
    assert copied_block(row_codes(people)) is None
    many = pd.DataFrame({"p": np.repeat(np.arange(300), 200), "c": np.tile(["a", "b", "c", "d"], 15_000)})
    many["y"] = rng.integers(1, 6, len(many))
    assert copied_block(row_codes(many)) is None
    thrice = pd.concat([many[:200]] * 3)
    assert copied_block(row_codes(thrice)) == (200, 0, 200)
