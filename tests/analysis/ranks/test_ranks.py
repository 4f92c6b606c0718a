"""Rank tests against base R (tests/golden/r/ranks.R), by definition, and by properties."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from analysis.cli import app
from analysis.ranks import rank_between, rank_within
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
