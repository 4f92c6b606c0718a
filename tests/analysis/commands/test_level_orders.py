"""Levels can be put in order in pairs, opinion and thresholds, as in anova; the numbers stay the same."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from experiments.load import load_experiment
from tests.analysis.ratings_file import rows_of, simulate, write_export

ORDER = ("low", "mid", "high")
FACTORS = pd.DataFrame({"item": ORDER, "kind": ["x", "y", "y"]})


def comparisons() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    rows = [
        (f"p{person}", a, b, b if rng.random() < 0.7 else a)
        for person in range(12)
        for a, b in (("low", "mid"), ("mid", "high"), ("low", "high"))
    ]
    return pd.DataFrame(rows, columns=["participant", "left", "right", "winner"])


def votes() -> pd.DataFrame:
    rng = np.random.default_rng(2)
    rows = [
        (f"p{person}", item, int(rng.integers(1, 4)) + place)
        for person in range(8)
        for place, item in enumerate(ORDER)
    ]
    return pd.DataFrame(rows, columns=["participant", "stimulus", "response"])


def trials() -> pd.DataFrame:
    rng = np.random.default_rng(3)
    x = np.tile([1.0, 2.0, 3.0, 4.0, 5.0], 60)
    eye = np.repeat(ORDER, 100)
    return pd.DataFrame({"x": x, "eye": eye, "response": (x + rng.normal(0, 1, 300) > 3).astype(int)})


COMMANDS = {
    "pairs": (comparisons, "pairs F", "left"),
    "opinion": (votes, "opinion F", "stimulus"),
    "thresholds": (trials, "thresholds F --by eye", "eye"),
}


def run(command: str, folder: Path, *further: str) -> Any:
    rows, words, _ = COMMANDS[command]
    file = folder / "rows.csv"
    rows().to_csv(file, index=False)
    return CliRunner().invoke(app, [*words.replace("F", str(file), 1).split(), *further])


def names_of(command: str, result: Any) -> list[str]:
    if command == "thresholds":
        return list(result["pooled"])
    return [one["name"] for one in result["items"]]


@pytest.mark.parametrize("command", COMMANDS)
def test_levels_come_in_the_order_given(command: str, tmp_path: Path) -> None:
    column, results = COMMANDS[command][2], []
    for number, further in enumerate(([], ["--levels", f"{column}=low,mid,high"])):
        target = tmp_path / f"{number}.json"
        done = run(command, tmp_path, *further, "--json", str(target))
        assert done.exit_code == 0, done.output
        results.append(json.loads(target.read_text()))
    assert names_of(command, results[0]) != list(ORDER)
    assert names_of(command, results[1]) == list(ORDER)
    assert "in the order given: low, mid, high" in " ".join(done.output.split())


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("levels", "words"),
    [
        ("{}=low,mid", "high missing"),
        ("{}=low,mid,hihg", "did you mean"),
        ("other=a,b", "no factor is"),
    ],
)
def test_other_orders_are_refused(command: str, levels: str, words: str, tmp_path: Path) -> None:
    done = run(command, tmp_path, "--levels", levels.format(COMMANDS[command][2]))
    assert done.exit_code != 0
    assert words in " ".join((done.output + str(done.exception)).split()).lower()


def test_a_declaration_gives_the_order_of_its_factors(tmp_path: Path) -> None:
    """As `analysis run` prints them; the statistics are those of any order."""
    declared = load_experiment("exp3")
    export = write_export(tmp_path / "r.csv", declared, rows_of(declared, simulate(declared, 8)))
    words = ["anova", str(export), "--participant", "participant", "--rating", "response"]
    words += ["--within", "lower_lid"]
    results = []
    for number, further in enumerate(([], ["--levels", "exp3"])):
        target = tmp_path / f"{number}.json"
        done = CliRunner().invoke(app, [*words, *further, "--json", str(target)])
        assert done.exit_code == 0, done.output
        results.append(json.loads(target.read_text()))
    names = [level.name for level in declared.factor("lower_lid").levels]
    orders = [[mean["levels"]["lower_lid"] for mean in result["marginal_means"]] for result in results]
    assert orders == [sorted(names), names]
    assert sorted(names) != names
    first, second = (result["effects"][0]["univariate"] for result in results)
    assert first == pytest.approx(second)


@pytest.mark.parametrize(
    ("levels", "words"),
    [
        ("exp3", "none of the factors of exp3 is a factor here; it declares lower_lid"),
        ("nothing", "or an experiment's name or toml file, got 'nothing'"),
    ],
)
def test_an_experiment_without_these_factors_is_refused(levels: str, words: str, tmp_path: Path) -> None:
    done = run("pairs", tmp_path, "--levels", levels)
    assert done.exit_code != 0
    assert words in " ".join((done.output + str(done.exception)).split()).lower()


def test_a_factor_of_items_is_compared_with_the_level_given_first(tmp_path: Path) -> None:
    factors = tmp_path / "items.csv"
    FACTORS.to_csv(factors, index=False)
    estimates = []
    for levels in ("kind=x,y", "kind=y,x"):
        target = tmp_path / "r.json"
        done = run("pairs", tmp_path, "--factors", str(factors), "--levels", levels, "--json", str(target))
        assert done.exit_code == 0, done.output
        [test] = [one for one in json.loads(target.read_text())["factors"] if one["factor"] == "kind"]
        estimates.append((test["reference"], test["estimates"][0]))
    assert [reference for reference, _ in estimates] == ["x", "y"]
    assert estimates[0][1] == pytest.approx(-estimates[1][1])
