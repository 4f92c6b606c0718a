"""Tests without equal variances, of one sample, of equivalence and Conover's, against base R (t_tests.R)."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.ranks import rank_against, rank_between, rank_within
from analysis.t_tests import compare_groups, compare_with_value
from experiments.errors import InputError
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "tests" / "golden" / "r"
KNOWN = json.loads((FOLDER / "ranks.json").read_text(encoding="utf-8"))
GOLDEN = json.loads((FOLDER / "t_tests.json").read_text(encoding="utf-8"))
BOUNDS = tuple(GOLDEN["bounds"])
NAMES = ["old", "mid", "new"]


def _groups(case: str) -> list[np.ndarray]:
    values, groups = np.array(KNOWN[case]["values"]), np.array(KNOWN[case]["groups"])
    return [values[groups == name] for name in NAMES]


def test_welch_anova_and_pairs_agree_with_r() -> None:
    result = compare_groups("group", NAMES, _groups("groups_tied"), BOUNDS)
    assert result.welch is not None
    found = (result.welch.f_value, result.welch.df_effect, result.welch.df_error, result.welch.p_value)
    assert found == pytest.approx(tuple(GOLDEN["welch"].values()), rel=1e-8)
    for test, expected in zip(result.tests, GOLDEN["pairs"], strict=True):
        numbers = (test.t, test.df, test.p_value, *test.ci, test.d)
        assert numbers == pytest.approx([expected[k] for k in ("t", "df", "p", "low", "high", "d")], rel=1e-8)
        # R's ptukey is good to about 1e-7 here
        assert test.p_games_howell == pytest.approx(expected["games_howell"], rel=1e-6)
        assert test.p_equivalence == pytest.approx(expected["tost"], rel=1e-8)


@pytest.mark.parametrize("command", ["t-test", "ranks"])
@pytest.mark.parametrize("value", ["nan", "inf"])
def test_a_value_to_test_against_is_a_number(tmp_path: Path, command: str, value: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text("id,score\na,1\nb,2\nc,4\n", encoding="utf-8")
    options = ["--participant", "id", "--rating", "score", "--against", value]
    with pytest.raises(InputError, match=f"--against should be a number such as 4, got {value}"):
        app([command, str(file), *options], standalone_mode=False)


def test_one_sample_tests_agree_with_r() -> None:
    values = [np.array(KNOWN["groups_tied"]["values"])]
    test = compare_with_value(None, ["all"], values, 3.5, BOUNDS).tests[0]
    expected = GOLDEN["one_sample"]
    assert (test.t, test.p_value, test.p_equivalence) == pytest.approx(
        (expected["t"], expected["p"], expected["tost"]), rel=1e-8
    )
    for case in ("tied", "untied"):
        pair = rank_against(None, ["all"], [np.array(KNOWN[f"groups_{case}"]["values"])], 3.5).pairs[0]
        signed = GOLDEN["signed_ranks"][case]
        assert (pair.statistic, pair.p_value) == pytest.approx((signed["v"], signed["p"]), rel=1e-8)


@pytest.mark.parametrize("case", ["tied", "untied"])
def test_conover_and_equivalence_of_ranks_agree_with_r(case: str) -> None:
    groups = rank_between("group", NAMES, _groups(f"groups_{case}"), BOUNDS)
    expected = GOLDEN["conover_groups" if case == "tied" else "conover_untied"]
    assert [pair.conover_t for pair in groups.pairs] == pytest.approx(expected["t"], rel=1e-8)
    assert [pair.conover_p_holm for pair in groups.pairs] == pytest.approx(expected["p"], rel=1e-8)
    tost = GOLDEN["tost_groups" if case == "tied" else "tost_untied"]
    assert groups.pairs[0].p_equivalence == pytest.approx(tost, rel=1e-8)
    within = rank_within("face", ["a", "b", "c"], np.array(KNOWN[case]["values"], dtype=float), BOUNDS)
    expected = GOLDEN["conover_tied" if case == "tied" else "conover_smooth"]
    assert [pair.conover_t for pair in within.pairs] == pytest.approx(expected["t"], rel=1e-8)
    assert [pair.conover_p_holm for pair in within.pairs] == pytest.approx(expected["p"], rel=1e-8)
    tost = GOLDEN["tost_tied" if case == "tied" else "tost_within"]
    assert within.pairs[0].p_equivalence == pytest.approx(tost, rel=1e-8)


def test_two_groups_are_welchs_t_test() -> None:
    result = compare_groups("group", NAMES[:2], _groups("groups_untied")[:2])
    assert result.welch is not None
    assert result.welch.f_value == pytest.approx(result.tests[0].t ** 2)
    assert result.tests[0].p_games_howell == pytest.approx(result.tests[0].p_value, rel=1e-9)


def test_what_has_no_t_test_is_refused() -> None:
    one, several, flat = np.array([3.0]), np.array([1.0, 2.0, 4.0]), np.array([2.0, 2.0])
    with pytest.raises(InputError, match="group=a has one participant, and no variance"):
        compare_groups("group", ["a", "b"], [one, several])
    with pytest.raises(InputError, match="neither a nor b varies between participants"):
        compare_groups("group", ["a", "b"], [flat, flat + 1])
    with pytest.raises(InputError, match="'group' has one level, a; to test it against a value"):
        compare_groups("group", ["a"], [several])
    with pytest.raises(
        InputError, match="expected means of two participants or more that differ, got 2 times 2"
    ):
        compare_with_value(None, ["all"], [flat], 3.0)
    with pytest.raises(InputError, match="every value of all is 2; there is nothing to rank"):
        rank_against(None, ["all"], [flat], 2.0)
    assert compare_groups("group", ["a", "b"], [flat, several]).welch is None


def test_command_tests_groups_and_one_sample(tmp_path: Path) -> None:
    file, out = tmp_path / "ratings.csv", tmp_path / "tests.json"
    rows = zip(KNOWN["groups_tied"]["groups"], KNOWN["groups_tied"]["values"], strict=True)
    lines = [f"p{number},{group},{value}" for number, (group, value) in enumerate(rows)]
    file.write_text("\n".join(["id,group,score", *lines]) + "\n", encoding="utf-8")
    named = ["t-test", str(file), "--participant", "id", "--rating", "score"]
    runner = CliRunner()
    ordered = [*named, "--between", "group", "--levels", "group=old,mid,new", "--json", str(out)]
    ended = runner.invoke(app, ordered)
    assert ended.exit_code == 0, ended.output
    assert json.loads(out.read_text(encoding="utf-8"))["tests"][0]["t"] == pytest.approx(
        GOLDEN["pairs"][0]["t"]
    )
    assert "Welch's ANOVA of group: F(2, 17.72) = 2.84, p = .085" in ended.output
    ended = runner.invoke(app, [*named, "--against", "3.5", "--equivalence", "-0.5,0.8"])
    assert ended.exit_code == 0, ended.output
    assert "score - 3.5" in ended.output
    assert "p (TOST)" in ended.output
    for more, said in [
        ([], "expected groups (--between COLUMN), or a value (--against 4)"),
        (["--within", "group"], "--within needs --against VALUE here"),
    ]:
        ended = runner.invoke(app, [*named, *more])
        assert isinstance(ended.exception, InputError)
        assert said in str(ended.exception)


def test_means_of_seconds_are_printed_with_the_decimals_that_tell_them_apart(tmp_path: Path) -> None:
    """With two decimals each of these groups would have M = 0.32 and SD = 0.01."""
    path = tmp_path / "seconds.csv"
    rows = [f"{i},{'ab'[i % 2]},{0.3 + 0.012 * (i % 4) + 0.001 * (i % 3)}" for i in range(24)]
    path.write_text("\n".join(["id,g,y", *rows]), encoding="utf-8")
    call = ["t-test", str(path), "--participant", "id", "--rating", "y", "--between", "g"]
    printed = CliRunner().invoke(
        app, [*call, "--equivalence", "0.005", "--json", str(tmp_path / "numbers.json")]
    )
    assert printed.exit_code == 0, printed.output
    numbers = json.loads((tmp_path / "numbers.json").read_text(encoding="utf-8"))
    said = " ".join(printed.output.split())
    for group in numbers["groups"]:
        low, high = group["ci"]
        assert f"M = {group['mean']:.4f}, SD = {group['sd']:.4f}" in said
        assert f"95% CI [{low:.4f}, {high:.4f}]" in said
    assert f"{numbers['tests'][0]['difference']:.4f}" in said
    assert "inside [-0.005, 0.005]" in said
