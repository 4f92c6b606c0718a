"""Rank tests against base R (tests/golden/r/ranks.R), by definition, and by properties."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from analysis.cli import app
from analysis.ranks import rank_against, rank_between, rank_within
from analysis.report.rank_tables import levels_table, pairs_table
from experiments.errors import InputError
from tests.conftest import REPOSITORY

GOLDEN = json.loads((REPOSITORY / "tests" / "golden" / "r" / "ranks.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("case", ["tied", "untied"])
def test_friedman_and_wilcoxon_agree_with_r(case: str) -> None:
    expected = GOLDEN[case]
    result = rank_within("face", ["a", "b", "c"], np.array(expected["values"], dtype=float))
    assert result.test.chi2 == pytest.approx(expected["chi2"], rel=1e-10)
    assert result.test.p_value == pytest.approx(expected["p"], rel=1e-8)
    for pair, other in zip(result.pairs, expected["pairs"], strict=True):
        assert (pair.first, pair.second) == (other["first"], other["second"])
        assert pair.statistic == other["v"]
        assert pair.p_value == pytest.approx(other["p"], rel=1e-8)
        assert pair.exact == (case == "untied")


@pytest.mark.parametrize("case", ["groups_tied", "groups_untied"])
def test_kruskal_mann_whitney_and_dunn_agree_with_r(case: str) -> None:
    expected = GOLDEN[case]
    values, groups = np.array(expected["values"], dtype=float), np.array(expected["groups"])
    names = ["old", "mid", "new"]
    result = rank_between("group", names, [values[groups == name] for name in names])
    assert result.test.chi2 == pytest.approx(expected["chi2"], rel=1e-10)
    assert result.test.p_value == pytest.approx(expected["p"], rel=1e-8)
    for pair, other, dunn in zip(result.pairs, expected["pairs"], expected["dunn"], strict=True):
        assert pair.statistic == other["u"]
        assert pair.p_value == pytest.approx(other["p"], rel=1e-8)
        assert pair.dunn_z == pytest.approx(other["z"], rel=1e-10)
        assert pair.dunn_p_holm == pytest.approx(dunn, rel=1e-8)


def test_effects_reach_their_ends() -> None:
    ordered = np.array([[1.0, 2.0, 3.0]] * 6) + np.arange(6)[:, None] * 10
    result = rank_within("face", ["a", "b", "c"], ordered)
    assert result.test.effect == pytest.approx(1.0)
    assert [pair.r for pair in result.pairs] == [-1.0, -1.0, -1.0]
    apart = rank_between("group", ["low", "high"], [np.arange(5.0), np.arange(5.0) + 100])
    assert apart.pairs[0].r == -1.0
    assert apart.pairs[0].statistic == 0.0


@settings(deadline=None, max_examples=25)
@given(st.lists(st.tuples(*[st.integers(1, 7)] * 3), min_size=3, max_size=12))
def test_ranks_do_not_change_with_a_monotone_scale(rows: list[tuple[int, int, int]]) -> None:
    values = np.array(rows, dtype=float)
    if np.all(values == values[:, :1]):
        return
    one = rank_within("face", ["a", "b", "c"], values)
    other = rank_within("face", ["a", "b", "c"], np.exp(values))
    assert one.test.chi2 == pytest.approx(other.test.chi2)
    assert 0 <= one.test.effect <= 1 + 1e-12
    assert one.mean_ranks == pytest.approx(other.mean_ranks)


SUMS = [
    [10, 10, 13],
    [7, 5, 11],
    [15, 14, 20],
    [5, 6, 8],
    [16, 17, 16],
    [4, 7, 10],
    [17, 17, 18],
    [8, 7, 11],
    [7, 8, 7],
    [15, 14, 16],
    [13, 16, 20],
    [14, 10, 12],
    [5, 6, 9],
    [11, 13, 17],
]
"""Sums of three ratings of each participant at three levels."""


def test_means_of_trials_are_tied_in_spite_of_rounding() -> None:
    means = np.array(SUMS) / 3
    pairs = rank_within("face", ["a", "b", "c"], means).pairs
    # wilcox.test(y[, 1], y[, 2], paired = TRUE, digits.rank = 7) of R 4.2.2; without digits.rank R has
    # V = 28.5, p = .431 for the first pair, as 13/3 - 4 and 7/3 - 2 differ in the last bit.
    assert [pair.statistic for pair in pairs] == [32.5, 3, 4]
    assert [pair.p_value for pair in pairs] == pytest.approx([0.6301303, 0.005232232, 0.002478385], rel=1e-6)
    sums = rank_within("face", ["a", "b", "c"], np.array(SUMS, dtype=float)).pairs
    assert [(pair.p_value, pair.r) for pair in pairs] == [(pair.p_value, pair.r) for pair in sums]


def test_shifted_means_and_means_against_a_value_are_tied_in_spite_of_rounding() -> None:
    sums = np.array(SUMS, dtype=float)
    bounds = (-1 / 3, 1 / 3)
    for one, other in (
        (
            rank_against(None, ["all"], [sums[:, 0] / 3], 10 / 3),
            rank_against(None, ["all"], [sums[:, 0]], 10),
        ),
        (
            rank_between("group", ["a", "b"], [sums[:, 0] / 3, sums[:, 2] / 3], bounds),
            rank_between("group", ["a", "b"], [sums[:, 0], sums[:, 2]], (-1.0, 1.0)),
        ),
        (
            rank_within("face", ["a", "b"], sums[:, :2] / 3, bounds),
            rank_within("face", ["a", "b"], sums[:, :2], (-1.0, 1.0)),
        ),
    ):
        assert one.pairs[0].statistic == other.pairs[0].statistic
        assert one.pairs[0].p_value == pytest.approx(other.pairs[0].p_value)
        assert one.pairs[0].p_equivalence == pytest.approx(other.pairs[0].p_equivalence)
    with pytest.raises(InputError, match="there is nothing to rank"):
        rank_against(None, ["all"], [np.array([0.1 + 0.2, 0.3])], 0.3)


def test_values_far_from_zero_are_not_tied() -> None:
    """Such as moments in milliseconds since 1970."""
    sums = np.array(SUMS, dtype=float)
    far, near = (rank_within("face", ["a", "b", "c"], sums + origin) for origin in (1.76e12, 0.0))
    assert [pair.p_value for pair in far.pairs] == [pair.p_value for pair in near.pairs]


def test_an_interval_without_width_is_explained() -> None:
    ordered = np.array([[1.0, 2.0, 3.0]] * 6) + np.arange(6)[:, None] * 10
    agreed = rank_within("face", ["a", "b", "c"], ordered)
    varied = rank_within("face", ["a", "b", "c"], np.array(SUMS, dtype=float))
    for table in (levels_table, pairs_table):
        assert "An interval without width does not show certainty" in " ".join(table(agreed, "x").notes)
        assert "without width" not in " ".join(table(varied, "x").notes)


def test_nothing_to_rank_is_refused() -> None:
    with pytest.raises(InputError, match="rates all levels alike"):
        rank_within("face", ["a", "b"], np.ones((4, 2)))
    with pytest.raises(InputError, match="all values are alike"):
        rank_between("group", ["a", "b"], [np.ones(3), np.ones(4)])
    with pytest.raises(InputError, match="expected two levels and two participants, got 1 and 4"):
        rank_within("face", ["a"], np.arange(4.0)[:, None])


def test_command_reads_within_and_between(tmp_path: Path) -> None:
    lines = ["id,face,group,score"]
    for number, row in enumerate(GOLDEN["tied"]["values"]):
        group = "x" if number % 2 else "y"
        lines += [f"p{number},{face},{group},{value:g}" for face, value in zip("abc", row, strict=True)]
    file, out = tmp_path / "ratings.csv", tmp_path / "ranks.json"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    named = ["ranks", str(file), "--participant", "id", "--rating", "score"]
    runner = CliRunner()
    ended = runner.invoke(app, [*named, "--within", "face", "--levels", "face=c,b,a", "--json", str(out)])
    assert ended.exit_code == 0, ended.output
    known = json.loads(out.read_text(encoding="utf-8"))
    assert known["levels"] == ["c", "b", "a"]
    assert known["test"]["chi2"] == pytest.approx(GOLDEN["tied"]["chi2"])
    assert "Friedman test" in ended.output
    ended = runner.invoke(app, [*named, "--between", "group"])
    assert ended.exit_code == 0, ended.output
    assert "Kruskal-Wallis test" in ended.output
    ended = runner.invoke(app, named)
    assert isinstance(ended.exception, InputError)
    assert (
        str(ended.exception) == "expected a factor (--within or --between COLUMN), or a value (--against 4)"
    )
