"""A study of thresholds from its export: series and people fitted, compared, and what cannot be said so."""

import csv
import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.plans.plan import study_contents
from analysis.plans.threshold import READING
from analysis.read.study_answers import load_csv
from analysis.thresholds.answers import count_trials
from analysis.thresholds.psychometric import fit_threshold
from experiments import rules
from experiments.errors import InputError
from experiments.kinds import KINDS
from experiments.kinds.threshold import THRESHOLDS
from experiments.kinds.threshold_grid import series_of, stimuli
from experiments.load import locate, parse_experiment

BASE = re.sub(
    r"(?s)\[trial\].*?(?=\[display\])",
    lambda _: KINDS["threshold"].example + "\n",
    locate("exp3").read_text(encoding="utf-8"),
)
EXPERIMENT = parse_experiment(BASE)
TRUE, SD = 0.5, 0.2


def rows_of(people: int = 6, trials: int = 60, seed: int = 2) -> list[dict[str, object]]:
    """Answers of people whose thresholds lie around the middle of the stimuli, 0 to 1 of their range."""
    rng, rows = random.Random(seed), []
    values = list(stimuli(EXPERIMENT))
    low, width = values[0], values[-1] - values[0]
    guess = EXPERIMENT.trial.task.guess
    for person in range(people):
        own = TRUE + rng.gauss(0, 0.05)
        for place, series in enumerate(series_of(EXPERIMENT)):
            for position in range(1, trials + 1):
                value = rng.choice(values)
                z = ((value - low) / width - own - 0.15 * place) / SD
                share = guess + (0.98 - guess) * 0.5 * (1 + math.erf(z / math.sqrt(2)))
                right = rng.random() < share
                interval = rng.choice(["first", "second"])
                other = {"first": "second", "second": "first"}[interval]
                word = ("yes" if right else "no") if guess < 0.5 else (interval if right else other)
                row: dict[str, object] = dict.fromkeys(THRESHOLDS.csv_header(EXPERIMENT.factor_names), "")
                row |= {"study": "s", "experiment": EXPERIMENT.name, "phase": "live", "synthetic": 1}
                row |= {"run": f"r{person}", "participant": f"P{person}", "run_status": "complete"}
                row |= {"kind": "main", "play": 1, "trial_index": 1000 * place + position, "rt": 800}
                row |= {"series": series.name, "position": position, "value": value, "interval": interval}
                row |= {"response": word, "verdict": "good", "excluded": 0, "run_origin": "simulated"}
                rows.append(row | {"study_version": 1, "data_series": 1})
    return rows


@pytest.fixture(scope="module")
def rows() -> list[dict[str, object]]:
    return rows_of()


def write(path: Path, rows: list[dict[str, object]]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, THRESHOLDS.csv_header(EXPERIMENT.factor_names))
        writer.writeheader()
        writer.writerows(rows)
    return path


def report(folder: Path, rows: list[dict[str, object]], experiment=EXPERIMENT):
    return study_contents(experiment, load_csv(write(folder / "t.csv", rows), experiment, READING))


def positive(row: dict[str, object]) -> float:
    return float(row["response"] == "yes" or row["response"] == row["interval"])


def test_each_series_is_the_fit_of_its_own_trials(tmp_path, rows) -> None:
    numbers = report(tmp_path, rows).numbers
    trial = EXPERIMENT.trial
    for series in series_of(EXPERIMENT):
        mine = [row for row in rows if row["series"] == series.name]
        x, y = np.array([float(row["value"]) for row in mine]), np.array([positive(row) for row in mine])
        falling = trial.direction == "falling"
        fit = fit_threshold(
            count_trials(x, y), trial.function, trial.task.guess, trial.lapse, falling=falling
        )
        assert numbers["pooled"][series.name]["threshold"] == pytest.approx(fit.threshold)
        values = list(stimuli(EXPERIMENT))
        assert values[0] < fit.threshold < values[-1]
    assert {one["condition"] for one in numbers["people"]} == {s.name for s in series_of(EXPERIMENT)}
    assert (numbers["kind"], numbers["n_participants"], numbers["n_trials"]) == ("threshold", 6, len(rows))


def test_the_report_leads_with_the_answer_for_people(tmp_path, rows) -> None:
    contents = report(tmp_path, rows)
    part, numbers = contents.parts[0], contents.numbers
    keys = [table.key for table in part.tables]
    assert keys[0] == "threshold-means"
    assert keys.index("threshold-differences") < keys.index("thresholds")
    means = {numbers["labels"][mean["condition"]]: mean for mean in numbers["means"]}
    assert {row[0]: row[2] for row in part.tables[0].rows} == {
        label: f"{mean['mean']:.3f}" for label, mean in means.items()
    }
    assert all(any(label in line and "the mean threshold" in line for line in part.brief) for label in means)


def test_of_one_person_the_fit_over_all_trials_leads(tmp_path, rows) -> None:
    alone = [row for row in rows if row["participant"] == "P0"]
    part = report(tmp_path, alone).parts[0]
    assert part.tables[0].key == "thresholds"
    assert "over all trials" in part.brief[0]


def test_series_are_compared_within_people(tmp_path, rows) -> None:
    numbers = report(tmp_path, rows).numbers
    names = [series.name for series in series_of(EXPERIMENT)]
    assert len(numbers["differences"]) == len(names) * (len(names) - 1) // 2
    own = {(p["condition"], p["participant"]): p["fit"]["threshold"] for p in numbers["people"]}
    people = sorted({who for _, who in own})
    for found in numbers["differences"]:
        sides = [[own[found[side], who] for who in people] for side in ("first", "second")]
        t, p = stats.ttest_rel(*sides)
        assert (found["t"], found["p"]) == (pytest.approx(t), pytest.approx(p))


def test_rules_exclude_as_of_ratings(tmp_path, rows) -> None:
    strict = EXPERIMENT.model_copy(update={"exclusions": (rules.ExcludeStraightLining(),)})
    same = str(rows[0]["response"])
    changed = [row | {"response": same} if row["run"] == "r2" else row for row in rows]
    found = report(tmp_path, changed, strict)
    (excluded,) = found.numbers["exclusions"]["runs"]
    assert excluded["reasons"] == ("same_response_share: 100% of answers are the same",)


def test_a_series_that_cannot_be_fitted_is_said(tmp_path, rows) -> None:
    name = series_of(EXPERIMENT)[0].name
    changed = [
        row | {"response": "yes" if row["response"] in ("yes", "no") else row["interval"]}
        if row["series"] == name
        else row
        for row in rows
    ]
    found = report(tmp_path, changed)
    assert "answers are the same" in found.numbers["reasons"][name]
    assert any("no function was fitted" in sentence for sentence in found.parts[0].sentences)


def test_methods_describe_what_was_run(tmp_path) -> None:
    everybody, one = (report(tmp_path, rows_of(people)) for people in (6, 1))
    assert "REML" in everybody.methods
    assert "paired t tests, Holm" in everybody.methods
    assert "Welch" not in everybody.methods
    assert "REML" not in one.methods
    assert "t tests" not in one.methods
    said = one.parts[0].sentences[0]
    assert "where the function without guesses and lapses is one half" in said
    assert "95% CI [" in said


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"response": "maybe"}, "participant P0, trial 1: 'maybe' is not a valid answer"),
        ({"series": "other"}, "'other' is not a valid series"),
        ({"value": ""}, "expected the stimulus value in 'value'"),
    ],
)
def test_wrong_rows_are_refused_by_participant_and_trial(tmp_path, rows, values, message) -> None:
    with pytest.raises(InputError, match=message):
        report(tmp_path, [rows[0] | values, *rows[1:]])


def test_the_report_is_whole_and_marked(tmp_path, rows) -> None:
    (tmp_path / "e.toml").write_text(BASE, encoding="utf-8")
    path = write(tmp_path / "t.csv", rows)
    done = CliRunner().invoke(
        app, ["run", str(tmp_path / "e.toml"), "--csv", str(path), "--out", str(tmp_path / "out")]
    )
    assert done.exit_code == 0, done.output
    assert max(map(len, done.stdout.replace(str(tmp_path), "").splitlines())) <= 80
    assert "SYNTHETIC DATA" in done.stdout
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "0 inconsistent." in text
    assert (tmp_path / "out" / "figure-thresholds.svg").stat().st_size > 1000
    found = report(tmp_path, rows)
    assert all("[SYNTHETIC DATA]" in table.title for table in found.parts[0].tables)
