"""A study of thresholds over two factors, and one with groups, from rows of the view to the report."""

import csv
import random
import re
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from scipy import stats

from analysis.plans.plan import study_contents
from analysis.plans.threshold import READING
from analysis.read.study_answers import load_csv
from analysis.report.contents import Contents
from analysis.report.numbers import fixed
from analysis.report.threshold_contents import compared_by
from analysis.report.write import write_report
from analysis.thresholds.plane import counted_points, fit_plane
from analysis.thresholds.series import differences
from experiments.declaration.experiment import Experiment
from experiments.errors import InputError
from experiments.kinds.threshold import THRESHOLDS
from experiments.kinds.threshold_grid import points, series_in_group, series_of
from experiments.load import parse_experiment
from tests.helpers.studies import SHORT
from tests.helpers.thresholds import FACTORS, YES_NO, text_with

SECOND = 'second = { factor = "character", values = { photorealistic = 0, cartoon = 1 } }'
GRID = YES_NO.replace('{ factor = "duration" }', f'{{ factor = "duration", {SECOND} }}')
SHAPE = """
[[factors]]
name = "shape"
label = "Shape"
{between}
levels = [{{ name = "SL", label = "Symmetric" }}, {{ name = "AL", label = "Asymmetric" }}]
"""
TRUE = {"SL": 260.0, "AL": 340.0}
TILT = 90.0


def experiment_with(between: str, trial: str = GRID) -> Experiment:
    return parse_experiment(text_with(SHORT, trial, FACTORS + SHAPE.format(between=between)))


WITHIN, BETWEEN = experiment_with(""), experiment_with("between = true")
ALONG_ONE = experiment_with("between = true", YES_NO)


def rows_of(experiment: Experiment, people: int = 6, trials: int = 120) -> list[dict[str, object]]:
    """Answers of people whose thresholds differ by shape, and move along the second number."""
    rng, rows = random.Random(2), []
    empty: dict[str, object] = dict.fromkeys(THRESHOLDS.csv_header(experiment.factor_names), "")
    empty |= {"study": "s", "experiment": experiment.name, "phase": "live", "synthetic": 1, "kind": "main"}
    empty |= {"run_status": "complete", "play": 1, "interval": "shown", "rt": 800, "verdict": "good"}
    empty |= {"excluded": 0, "run_origin": "simulated", "study_version": 1, "data_series": 1}
    groups = [factor for factor in experiment.factors if factor.between]
    for person in range(people):
        mine = [(one.name, one.levels[person % 2].name) for one in groups]
        own = rng.gauss(0, 15)
        for place, series in enumerate(series_in_group(experiment, mine)):
            true = TRUE[series.levels["shape"]] + own
            for position in range(1, trials + 1):
                point, levels = rng.choice(list(points(experiment).items()))
                z = (point.value - true - TILT * ((point.second or 0.0) - 0.5)) / 90
                word = "yes" if rng.random() < 0.02 + 0.96 * NormalDist().cdf(z) else "no"
                rows.append(
                    empty
                    | {"run": f"r{person}", "participant": f"P{person}", "series": series.name}
                    | {"trial_index": 1000 * place + position, "position": position}
                    | {"value": point.value, "response": word}
                    | dict(series.levels)
                    | levels
                )
    return rows


def report(folder: Path, experiment: Experiment, rows: list[dict[str, object]]) -> Contents:
    path = folder / "t.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, THRESHOLDS.csv_header(experiment.factor_names))
        writer.writeheader()
        writer.writerows(rows)
    return study_contents(experiment, load_csv(path, experiment, READING))


@pytest.fixture(scope="module")
def rows() -> list[dict[str, object]]:
    return rows_of(WITHIN)


@pytest.fixture(scope="module")
def within(rows: list[dict[str, object]], tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return report(tmp_path_factory.mktemp("within"), WITHIN, rows)


def test_each_series_is_the_fit_of_its_own_trials_over_both_factors(
    within: Contents, rows: list[dict[str, object]]
) -> None:
    contents = within
    for series in series_of(WITHIN):
        mine = [row for row in rows if row["series"] == series.name]
        x = np.array([float(str(row["value"])) for row in mine])
        z = np.array([0.0 if row["character"] == "photorealistic" else 1.0 for row in mine])
        fit = fit_plane(
            counted_points(x, z, np.array([float(row["response"] == "yes") for row in mine])),
            "normal",
            0.02,
            0.02,
        )
        stated = contents.numbers["pooled"][series.name]
        assert (stated["threshold"], stated["tilt"]) == (
            pytest.approx(fit.threshold),
            pytest.approx(fit.tilt),
        )
        assert abs(fit.threshold - TRUE[series.levels["shape"]]) < 4 * fit.threshold_se
        assert abs(fit.tilt - TILT) < 4 * fit.tilt_se
        means = contents.numbers["means"][series.name]
        assert means["threshold"]["people"] == 6
    assert any("Its tilt, the change per unit of" in sentence for sentence in contents.parts[0].sentences)


def test_series_are_compared_in_pairs_in_threshold_and_tilt(within: Contents) -> None:
    numbers = within.numbers
    assert [one["what"] for one in numbers["differences"]] == ["threshold", "tilt"]
    for one in numbers["differences"]:
        each = {
            name: [
                row["fit"][one["what"]]
                for row in sorted(numbers["people"], key=lambda row: row["participant"])
                if row["condition"] == one[name]
            ]
            for name in ("first", "second")
        }
        t, p = stats.ttest_rel(each["first"], each["second"])
        assert (one["t"], one["p"], one["df"]) == (pytest.approx(t), pytest.approx(p), 5)
    assert numbers["differences"][0]["p_holm"] < 0.01


@pytest.mark.parametrize("experiment", [BETWEEN, ALONG_ONE], ids=["two_factors", "one_factor"])
def test_series_of_two_groups_are_compared_by_welch(tmp_path: Path, experiment: Experiment) -> None:
    numbers = report(tmp_path, experiment, rows_of(experiment)).numbers
    pair = [row for row in numbers["differences"] if row["what"] == "threshold"]
    for one in pair:
        each = [
            [row["fit"]["threshold"] for row in numbers["people"] if row["condition"] == one[name]]
            for name in ("first", "second")
        ]
        if set(map(len, each)) == {3} and {one["first"], one["second"]} in GROUPS[experiment is BETWEEN]:
            t, p = stats.ttest_ind(*each, equal_var=False)
            assert (one["t"], one["p"], one["people"]) == (pytest.approx(t), pytest.approx(p), 6)
            assert not one["paired"]
            break
    else:
        raise AssertionError(pair)


def test_groups_whose_welch_df_are_whole_by_chance_are_not_called_paired() -> None:
    """Equal sizes and variances: Welch's df are those of Student."""
    first, second = {"a": 1.0, "b": 2.0, "c": 3.0}, {"d": 2.0, "e": 3.0, "f": 4.0}
    between = differences([("s1", first), ("s2", second)])
    assert between[0].df == 4
    assert compared_by(between) == "Series are compared between groups by Welch's t tests, Holm-corrected. "
    within = differences([("s1", first), ("s2", dict(zip("abc", (2.0, 3.5, 4.0), strict=True)))])
    assert compared_by(within) == "Series are compared within people by paired t tests, Holm-corrected. "


def test_a_person_in_both_of_two_groups_is_left_out_of_their_comparison() -> None:
    first, second = {f"a{i}": float(i) for i in range(6)}, {f"b{i}": float(i * i) for i in range(6)}
    apart = differences([("s1", first), ("s2", second)])
    shared = differences([("s1", first | {"x": 40.0}), ("s2", second | {"x": -3.0})])
    assert shared == (replace(apart[0], left_out=1),)
    # Half of a small group is not most of it: two pairs would have one degree of freedom.
    half = differences(
        [("s1", {**first, "x": 1.0, "y": 2.0}), ("s2", {"x": 1.5, "y": 2.6, "z": 4.0, "w": 5.0})]
    )
    assert (half[0].paired, half[0].left_out) == (False, 2)
    assert "without 1 participant who took part in both groups" in compared_by(shared)
    assert "without up to 1 participant who" in compared_by((*apart, *shared))


GROUPS = {True: ({"s1", "s2"},), False: ({"s1", "s2"}, {"s3", "s4"}, {"s1", "s4"})}


def test_the_report_says_how_the_threshold_tilts_with_its_interval(within: Contents) -> None:
    for series, label in within.numbers["labels"].items():
        fit = within.numbers["population"][series]
        assert fit["people"] == 6
        assert fit["tilt_ci"]["low"] < TILT < fit["tilt_ci"]["high"]
        [sentence] = [said for said in within.parts[0].sentences if said.startswith(f"{label}: ")]
        low, high = (fixed(fit["tilt_ci"][end], 0) for end in ("low", "high"))
        said = f"was {fixed(fit['tilt'], 0)}, 95% CI [{low}, {high}], so that it depends on Character"
        assert said in sentence
    parameters = within.parts[0].tables[0]
    assert [row[0] for row in parameters.rows[:2]] == [
        f"{label}, 6 people" for label in within.numbers["labels"].values()
    ]


def test_the_report_has_its_tables_and_lines(tmp_path: Path, within: Contents) -> None:
    paths = [path.name for path in write_report(within, tmp_path / "report")]
    assert {"report.html", "figure-thresholds.svg"} <= set(paths)
    text = (tmp_path / "report" / "report.md").read_text(encoding="utf-8")
    assert "Threshold along Character" in text
    assert "SYNTHETIC" in text


def test_an_unknown_level_of_the_second_factor_is_named(
    tmp_path: Path, rows: list[dict[str, object]]
) -> None:
    wrong = [rows[0] | {"character": "cartun"}, *rows[1:]]
    with pytest.raises(InputError, match=re.escape("'cartun'")):
        report(tmp_path, WITHIN, wrong)
