"""Degradation scores against published ones, and what is said of scales whose ranges differ."""

import csv
import itertools
import json
import re
import statistics
from collections.abc import Iterator, Mapping

import pandas as pd
import pytest

from analysis.plans.degradation import CellScore, extremes, scores
from analysis.plans.exclusions import Exclusions
from analysis.plans.plan import PlanRows
from analysis.read.study_answers import StudyAnswers
from experiments.load import parse_experiment
from tests.conftest import REPOSITORY

DEMO = (REPOSITORY / "experiments" / "dcr-demo.toml").read_text(encoding="utf-8")
GOLDEN = REPOSITORY / "tests" / "golden" / "dcr"
T_25 = 2.059539
"""The 0.975 quantile of t with 25 degrees of freedom, from a printed table."""


def contents() -> Iterator[dict[str, str]]:
    """The votes of each content by video, one digit per person."""
    with (GOLDEN / "nflx_public.csv").open(encoding="utf-8") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: row["content"])
    for _, of in itertools.groupby(rows, key=lambda row: row["content"]):
        yield {row["video"]: row["votes"] for row in of}


def scored(votes: Mapping[str, str]) -> dict[str, CellScore]:
    """The scores of one content, whose videos are the levels of a factor."""
    levels = "".join(f'[[factors.levels]]\nname = "{name}"\nlabel = "{name}"\n\n' for name in votes)
    text = re.sub(r"(?s)\[\[factors\.levels\]\].*?(?=\[render\])", levels, DEMO)
    experiment = parse_experiment(text.replace('level = "both"', 'level = "reference"'))
    rows = pd.DataFrame(
        [
            {"participant": f"p{person}", "lower_lid": name, "response": float(vote)}
            for name, given in votes.items()
            for person, vote in enumerate(given)
        ]
    )
    exclusions, answers = Exclusions((), (), (), (), 26, rows), StudyAnswers(rows, "golden", (), {})
    return {one.cell: one for one in scores(PlanRows(experiment, "golden", False, exclusions, (), answers))}


def test_scores_are_those_that_another_program_publishes() -> None:
    """Netflix's votes of 79 videos by 26 people, and the scores that its sureal expects of them."""
    published = json.loads((GOLDEN / "published.json").read_text(encoding="utf-8"))
    every = [scored(votes) for votes in contents()]
    assert [one.n for cells in every for one in cells.values()] == [26] * 79
    given = [one.differential for cells in every for one in cells.values()]
    assert given.count(None) == 9, "a reference has no score against itself; sureal counts it 5"
    differential = [5.0 if one is None else one for one in given]
    assert statistics.mean(differential) == pytest.approx(published["dmos"]["mean"], abs=1e-9)
    means = [one.dmos for cells in every for one in cells.values()]
    assert statistics.mean(means) == pytest.approx(published["mos"]["mean"], abs=1e-9)
    first = every[0]
    assert first["reference"].dmos == pytest.approx(published["mos"]["asset_0"], abs=1e-9)
    assert first["v10"].dmos == pytest.approx(published["mos"]["asset_10"], abs=1e-9)
    assert first["v10"].differential == pytest.approx(published["dmos"]["asset_10"], abs=1e-9)


def test_intervals_are_those_of_the_formula() -> None:
    """Mean and t times sd / sqrt(n), of votes and of each person's difference, without this project."""
    votes = next(contents())
    own, reference = ([int(vote) for vote in votes[name]] for name in ("v10", "reference"))
    differences = [mine - of_reference + 5 for mine, of_reference in zip(own, reference, strict=True)]
    one = scored(votes)["v10"]
    for values, low, high in (
        (own, one.ci_low, one.ci_high),
        (differences, one.differential_low, one.differential_high),
    ):
        reach = T_25 * statistics.stdev(values) / 26**0.5
        mean = statistics.mean(values)
        assert (low, high) == pytest.approx((mean - reach, mean + reach), abs=1e-5)


def cell(scale: str, name: str, dmos: float) -> CellScore:
    """A cell's score on a scale, and nothing else of note."""
    return CellScore(scale, False, name, name, dmos, 1.0, 9, dmos - 1, dmos + 1, None, None, None)


def test_the_least_impaired_cell_is_found_on_each_scale() -> None:
    """Of a slider from 0 to 100 and points from 1 to 5, every cell of the slider lies above."""
    every = (
        cell("sharpness", "a", 20.0),
        cell("sharpness", "b", 80.0),
        cell("motion", "a", 4.5),
        cell("motion", "b", 2.0),
    )
    assert extremes(every) == (
        "The least impaired cell on sharpness was b (DMOS 80.00, n = 9); "
        "the most impaired was a (DMOS 20.00, n = 9).",
        "The least impaired cell on motion was a (DMOS 4.50, n = 9); "
        "the most impaired was b (DMOS 2.00, n = 9).",
    )


def test_a_scale_without_ratings_says_so() -> None:
    every = (cell("sharpness", "a", float("nan")), cell("motion", "a", 4.0))
    assert extremes(every)[0] == "No cell has a rating on sharpness."
    assert extremes(()) == ("No cell has a rating.",)
