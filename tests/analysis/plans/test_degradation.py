"""Degradation category rating from the declaration to the report: unrated references, reversed scales."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from analysis.cli import app
from experiments.errors import InputError
from tests.conftest import REPOSITORY

DEMO = (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8")
NOT_RATED = DEMO.replace("rate_itself = true", "rate_itself = false")


def run(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, [str(one) for one in arguments])
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study whose reference is not rated, and synthetic ratings of it."""
    folder = tmp_path_factory.mktemp("dcr")
    (folder / "dcr.toml").write_text(NOT_RATED, encoding="utf-8")
    wish = ("--effect", "lower_lid=6.5", "--n", "12")
    run("synthesise", folder / "dcr.toml", *wish, "--out", folder / "ratings.csv")
    return folder


def test_a_reference_that_is_not_rated_is_not_synthesised(synthetic: Path) -> None:
    with (synthetic / "ratings.csv").open(encoding="utf-8") as file:
        assert {row["lower_lid"] for row in csv.DictReader(file)} == {"vertical", "none"}
    options = ("--csv", synthetic / "ratings.csv", "--no-sensitivity")
    run("run", synthetic / "dcr.toml", *options, "--out", synthetic / "out")
    every = json.loads((synthetic / "out" / "results.json").read_text(encoding="utf-8"))["degradation"]
    assert [one["cell"] for one in every] == ["vertical", "none"]


def test_ratings_of_a_reference_that_is_not_rated_are_refused(synthetic: Path) -> None:
    text = (synthetic / "ratings.csv").read_text(encoding="utf-8")
    (synthetic / "wrong.csv").write_text(text.replace("vertical", "both"), encoding="utf-8")
    options = ["--csv", str(synthetic / "wrong.csv"), "--out", str(synthetic / "none")]
    done = CliRunner().invoke(app, ["run", str(synthetic / "dcr.toml"), *options])
    assert isinstance(done.exception, InputError)
    assert "the reference's level 'both' of 'lower_lid', which is not rated" in str(done.exception)


def scores(folder: Path, declared: str, answers: list[dict[str, str]]) -> tuple[list[dict[str, Any]], str]:
    """Degradation scores and report of these answers to this study."""
    folder.mkdir()
    (folder / "dcr.toml").write_text(declared, encoding="utf-8")
    with (folder / "ratings.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(answers[0]))
        writer.writeheader()
        writer.writerows(answers)
    options = ("--csv", folder / "ratings.csv", "--no-sensitivity", "--out", folder / "out")
    run("run", folder / "dcr.toml", *options)
    every = json.loads((folder / "out" / "results.json").read_text(encoding="utf-8"))["degradation"]
    return every, (folder / "out" / "report.md").read_text(encoding="utf-8")


def test_answers_on_a_reversed_scale_are_turned(tmp_path: Path) -> None:
    """The same judgements on a scale whose high answers mean much impairment have the same scores."""
    given = {"both": (5, 5, 4, 5), "vertical": (4, 3, 4, 3), "none": (1, 2, 1, 3)}
    answers = [
        {
            "participant": f"p{person}",
            "run": f"r{person}",
            "kind": "main",
            "lower_lid": level,
            "exemplar": "1",
            "trial_index": str(index),
            "response": str(rated[person]),
        }
        for index, (level, rated) in enumerate(given.items())
        for person in range(4)
    ]
    turned = [one | {"response": str(6 - int(one["response"]))} for one in answers]
    reverse = DEMO.replace("[trial.scale]\n", "[trial.scale]\nreverse = true\n")
    plain, _ = scores(tmp_path / "plain", DEMO, answers)
    reversed_, report = scores(tmp_path / "reversed", reverse, turned)
    assert [one["dmos"] for one in reversed_] == [4.75, 3.5, 1.75]
    assert [one["differential"] for one in reversed_] == [None, 3.75, 2.0]
    assert [one | {"turned": True} for one in plain] == reversed_
    assert "The least impaired cell was Moves in both directions" in report
    assert "reverse-keyed scale are reversed" in report


def test_cells_are_compared_on_one_scale_at_a_time(tmp_path: Path) -> None:
    """Scales may differ in range: the lowest cell of a slider to 100 is above the best of points to 5."""
    question = DEMO[DEMO.index("question") : DEMO.index("\n", DEMO.index("question"))]
    scale = DEMO[DEMO.index("[trial.scale]") : DEMO.index("[trial.reference]")]
    ends = 'low = { en = "none", de = "kein" }\nhigh = { en = "all", de = "alle" }\n'
    slider = f'[[trial.scales]]\nname = "sharpness"\ntype = "slider"\n{question}\n{ends}\n'
    several = scale.replace("[trial.scale]\n", '[[trial.scales]]\nname = "impairment"\n')
    given = {"both": (5, 60), "vertical": (3, 90), "none": (1, 70)}
    answers = [
        {
            "participant": f"p{person}",
            "run": f"r{person}",
            "kind": "main",
            "lower_lid": level,
            "exemplar": "1",
            "trial_index": str(index),
            "scale": name,
            "response": str(rated),
        }
        for index, (level, both) in enumerate(given.items())
        for name, rated in zip(("impairment", "sharpness"), both, strict=True)
        for person in range(4)
    ]
    _, report = scores(tmp_path / "several", DEMO.replace(scale, several + slider), answers)
    assert "The least impaired cell on impairment was Moves in both directions (DMOS 5.00" in report
    assert "The least impaired cell on sharpness was Vertical only (DMOS 90.00" in report
