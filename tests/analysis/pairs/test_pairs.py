"""Paired comparisons: published values, invariances, and refusals that say what to do."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.pairs.abilities import PairsResult, fit_abilities
from analysis.pairs.comparisons import read_comparisons
from experiments.errors import InputError

# Agresti (2013), Categorical Data Analysis, section 11.6: American League 1987, wins of row over column.
TEAMS = ("Milwaukee", "Detroit", "Toronto", "New York", "Boston", "Cleveland", "Baltimore")
WINS = (
    (0, 7, 9, 7, 7, 9, 11),
    (6, 0, 7, 5, 11, 9, 9),
    (4, 6, 0, 7, 7, 8, 12),
    (6, 8, 6, 0, 6, 7, 10),
    (6, 2, 6, 7, 0, 7, 12),
    (4, 4, 5, 6, 6, 0, 6),
    (2, 4, 1, 3, 1, 7, 0),
)
PUBLISHED = {
    "Milwaukee": 1.58,
    "Detroit": 1.44,
    "Toronto": 1.29,
    "New York": 1.25,
    "Boston": 1.11,
    "Cleveland": 0.68,
    "Baltimore": 0.0,
}

Row = tuple[str, str, str]


def table(folder: Path, rows: list[Row], name: str = "pairs.csv") -> Path:
    path = folder / name
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["left", "right", "winner"])
        writer.writerows(rows)
    return path


def fitted(path: Path, **options: object) -> PairsResult:
    return fit_abilities(read_comparisons(path, "left", "right", "winner", "tie"), **options)  # type: ignore[arg-type]


def test_baseball_equals_the_textbook(tmp_path: Path) -> None:
    rows = [(TEAMS[a], TEAMS[b], TEAMS[a]) for a in range(7) for b in range(7) for _ in range(WINS[a][b])]
    result = fitted(table(tmp_path, rows))
    assert result.reference == "Baltimore"
    for item in result.items:
        assert item.ability == pytest.approx(PUBLISHED[item.name], abs=0.006)
    assert result.goodness.df == 15
    assert result.goodness.deviance == pytest.approx(15.737, abs=0.005)
    assert [item.name for item in result.items if item.rank == 1] == ["Milwaukee"]


@settings(max_examples=8)
@given(st.integers(0, 10_000))
def test_sides_and_names_of_the_winner_do_not_matter(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    names = ["a", "b", "c", "d"]
    rows: list[Row] = []
    for _ in range(120):
        left, right = rng.choice(names, 2, replace=False)
        rows.append((str(left), str(right), str(rng.choice(["left", "right", "tie"]))))
    sides = {"left": "right", "right": "left", "tie": "tie"}
    swapped = [(right, left, sides[winner]) for left, right, winner in rows]
    named = [(a, b, {"left": a, "right": b, "tie": "tie"}[w]) for a, b, w in rows]
    folder = tmp_path_factory.mktemp("pairs")
    first = fitted(table(folder, rows, "1.csv"), method="davidson")
    for index, other in enumerate((swapped, named), start=2):
        again = fitted(table(folder, other, f"{index}.csv"), method="davidson")
        np.testing.assert_allclose(
            [i.ability for i in first.items], [i.ability for i in again.items], atol=1e-8
        )
        assert again.log_likelihood == pytest.approx(first.log_likelihood)


def test_an_item_that_always_wins_is_named_and_firth_keeps_it_finite(tmp_path: Path) -> None:
    rows = [("a", "b", "left")] * 4 + [("b", "c", "left"), ("c", "b", "left")] * 3 + [("a", "c", "left")] * 4
    path = table(tmp_path, rows)
    with pytest.raises(InputError, match=r"a won every comparison with the others.*--firth"):
        fitted(path)
    result = fitted(path, firth=True)
    ability = {item.name: item.ability for item in result.items}
    assert ability["b"] == pytest.approx(ability["c"], abs=1e-6)
    assert -6 < ability["b"] < -1


@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_firth_of_few_comparisons_of_one_pair_is_the_log_of_twice_their_number_and_one(
    tmp_path: Path, n: int
) -> None:
    """The penalised score is w - n p + 1/2 - p, so that n of n won give p = (n + 1/2) / (n + 1)."""
    result = fitted(table(tmp_path, [("a", "b", "right")] * n), firth=True)
    assert result.items[1].ability == pytest.approx(np.log(2 * n + 1), rel=1e-8)


def test_firth_on_one_pair_adds_half_a_win_to_each_side(tmp_path: Path) -> None:
    result = fitted(table(tmp_path, [("a", "b", "right")] * 5), firth=True)
    assert result.items[1].ability == pytest.approx(np.log(5.5 / 0.5), rel=1e-8)


def test_groups_never_compared_are_refused(tmp_path: Path) -> None:
    rows = [("a", "b", "left"), ("b", "a", "left"), ("c", "d", "left"), ("d", "c", "left")]
    with pytest.raises(InputError, match=r"2 groups that were never compared: a, b \| c, d"):
        fitted(table(tmp_path, rows))


def test_davidson_shows_the_most_ties_there_can_be(tmp_path: Path) -> None:
    rows = [("a", "b", "left")] * 10 + [("a", "b", "right")] * 10 + [("a", "b", "tie")] * 10
    result = fitted(table(tmp_path, rows), method="davidson")
    assert result.items[1].ability == pytest.approx(0.0, abs=1e-9)
    assert result.tie_probability_max == pytest.approx(1 / 3)


def test_circles_are_counted(tmp_path: Path) -> None:
    rows = [("a", "b", "left", "1"), ("b", "c", "left", "1"), ("c", "a", "left", "1")]
    rows += [("a", "b", "left", "2"), ("b", "c", "left", "2"), ("a", "c", "left", "2")]
    path = tmp_path / "circle.csv"
    path.write_text("left,right,winner,id\n" + "\n".join(",".join(row) for row in rows) + "\n")
    comparisons = read_comparisons(path, "left", "right", "winner", None, "id")
    told = fit_abilities(comparisons).transitivity
    assert (told.triples, told.raters_with_all_pairs, told.circular_triads, told.circular_triads_max) == (
        1,
        2,
        1,
        2,
    )


def test_the_command_writes_what_it_promises(tmp_path: Path) -> None:
    rows = [
        ("007", "01", "007"),
        ("01", "007", "left"),
        ("01", "2", "right"),
        ("2", "007", "left"),
        ("2", "01", "01"),
    ]
    out = tmp_path / "out.json"
    done = CliRunner().invoke(app, ["pairs", str(table(tmp_path, rows)), "--json", str(out)])
    assert done.exit_code == 0, done.output
    told = json.loads(out.read_text())
    assert [item["name"] for item in told["items"]] == ["007", "01", "2"]
    assert told["items"][0]["ability"] == 0
    assert told["items"][0]["p"] is None
    assert {"ability", "se", "p", "rank"} <= told["items"][1].keys()
    assert told["method"] == "bradley-terry"


def test_contrasts_are_printed_with_both_errors_and_which_to_read(tmp_path: Path) -> None:
    """Raters who agree with themselves more than with others: robust errors are the larger ones."""
    rows = []
    for rater in range(8):
        favourite = "abac"[rater % 4]
        for left, right in (("a", "b"), ("b", "c"), ("a", "c")) * 4:
            chosen = favourite if favourite in (left, right) else left
            rows.append((left, right, chosen, f"r{rater}"))
    path, out = tmp_path / "t.csv", tmp_path / "o.json"
    text = "\n".join(",".join(row) for row in rows)
    path.write_text(f"left,right,winner,id\n{text}\n", encoding="utf-8")
    call = ["pairs", str(path), "--participant", "id", "--json", str(out)]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    contrasts = json.loads(out.read_text())["contrasts"]
    for one in contrasts:
        assert one["se_robust"] > 1.5 * one["se"]
        t = one["difference"] / one["se_robust"]
        assert one["p_robust"] == pytest.approx(2 * stats.t.sf(abs(t), 7))
        cells = next(line for line in done.output.splitlines() if f"{one['first']} - {one['second']}" in line)
        for printed in (one["se"], one["se_robust"]):
            assert f"{printed:.3f}" in cells
        assert f"{t:.2f}" in cells
    ordered = sorted(contrasts, key=lambda one: one["p_robust"])
    assert ordered[0]["p_robust_holm"] == pytest.approx(min(1.0, 3 * ordered[0]["p_robust"]))
    assert "Report the robust p if raters gave several comparisons" in " ".join(done.output.split())
    assert max(map(len, done.output.replace(str(tmp_path), "").splitlines())) <= 80


def test_without_raters_the_table_says_whose_errors_it_has(tmp_path: Path) -> None:
    rows = [("a", "b", "left"), ("b", "a", "left"), ("a", "b", "left")]
    done = CliRunner().invoke(app, ["pairs", str(table(tmp_path, rows))])
    assert "robust SE" not in done.output
    assert "raters to add robust errors" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([("a", "a", "left")], "line 2 compares 'a' with itself"),
        ([("a", "b", "c")], r"'winner' is 'c' in line 2; expected left, right or one of the row's two items"),
        ([("left", "b", "left")], "an item is called 'left'"),
        ([("a", "b", "")], "names no winner in any row"),
        ([("a", "", "left")], "'right' is empty in line 2"),
        ([("a", "b", "tie"), ("a", "b", "left"), ("a", "b", "right")], "1 comparisons are ties"),
    ],
)
def test_bad_tables_are_one_line(tmp_path: Path, rows: list[Row], told: str) -> None:
    with pytest.raises(InputError, match=told):
        fitted(table(tmp_path, rows))


def test_of_an_export_only_answers_that_count_are_compared(tmp_path: Path) -> None:
    rows = [
        ("main", "good", "0", "a", "b", "left"),
        ("main", "flagged", "0", "b", "c", "right"),
        ("main", "uncertain", "0", "a", "c", "left"),
        ("practice", "good", "0", "a", "c", "right"),
        ("main", "failed", "0", "a", "c", "right"),
        ("main", "good", "1", "a", "c", "right"),
    ]
    names = ("kind", "verdict", "excluded", "left_cell", "right_cell", "winner")
    table = tmp_path / "comparisons.csv"
    table.write_text("\n".join(",".join(row) for row in (names, *rows)) + "\n")
    comparisons = read_comparisons(table, "left_cell", "right_cell", "winner")
    assert comparisons.outcome.tolist() == [0, 1, 0]
    assert "1 practice or attention trial excluded" in comparisons.decisions
    assert "1 failed play excluded" in comparisons.decisions
    # The same columns in somebody else's table mean nothing to us.
    table.write_text(table.read_text().replace("left_cell", "one").replace("right_cell", "two"))
    assert len(read_comparisons(table, "one", "two", "winner").outcome) == 6


@pytest.mark.parametrize(("tie", "what"), [("a", "an item"), ("Left", "a side")])
def test_a_word_for_ties_that_names_a_winner_is_refused(tmp_path: Path, tie: str, what: str) -> None:
    path = table(tmp_path, [("a", "b", "a"), ("b", "a", "Left"), ("a", "b", "b")])
    with pytest.raises(InputError, match=f"--tie {tie} is also {what}; expected a word that names no winner"):
        read_comparisons(path, "left", "right", "winner", tie)
