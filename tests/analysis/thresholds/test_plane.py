"""Thresholds over two variables against R (tests/golden/r/plane.R), people, and refusals in one line."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.thresholds.answers import read_answers
from analysis.thresholds.plane import Points, counted_points, fit_plane
from analysis.thresholds.plane_people import fit_planes
from experiments.errors import InputError

FOLDER = Path(__file__).parents[2] / "golden/r/plane"
REFERENCE: dict[str, Any] = json.loads((FOLDER / "reference.json").read_text(encoding="utf-8"))


def points(name: str) -> Points:
    answers = read_answers(FOLDER / f"{name}.csv", "duration", "seen", second="asymmetry")
    assert answers.second is not None
    return counted_points(answers.x, answers.second, answers.response)


@pytest.mark.parametrize(("name", "guess", "lapse"), [("yes_no", 0.0, 0.0), ("two_interval", 0.5, 0.02)])
def test_the_fit_and_its_profiles_equal_r(name: str, guess: float, lapse: float) -> None:
    fit, expected = fit_plane(points(name), "normal", guess, lapse), REFERENCE[name]
    assert fit.log_likelihood == pytest.approx(expected["logLik"], abs=1e-6)
    for what in ("threshold", "tilt", "spread"):
        assert getattr(fit, what) == pytest.approx(expected[what], rel=2e-6)
        interval = getattr(fit, f"{what}_ci")
        assert [interval.low, interval.high] == pytest.approx(expected[f"{what}_ci"], rel=1e-5)


def test_without_guesses_and_lapses_it_is_the_probit_regression() -> None:
    fit, expected = fit_plane(points("yes_no"), middle=0.5), REFERENCE["glm"]
    for what in ("threshold", "tilt", "spread", "threshold_se", "tilt_se", "deviance", "df"):
        assert getattr(fit, what) == pytest.approx(expected[what], rel=1e-6)


def test_the_line_has_the_threshold_and_the_interval_of_a_fit_with_its_middle_there() -> None:
    whole = fit_plane(points("two_interval"), guess=0.5, lapse=0.02)
    for point in whole.line:
        there = fit_plane(points("two_interval"), guess=0.5, lapse=0.02, middle=point.z)
        assert there.threshold == pytest.approx(point.threshold, rel=1e-6)
        assert there.threshold_ci.low == pytest.approx(point.ci.low, rel=1e-6)


def test_answers_that_lack_a_level_are_fitted_at_the_middle_that_is_said() -> None:
    """Compared at the middles of their answers, two series would differ by their tilt alone."""
    answers = read_answers(FOLDER / "yes_no.csv", "duration", "seen", second="asymmetry")
    assert answers.second is not None
    kept = answers.second < answers.second.max()
    less = replace(answers, x=answers.x[kept], response=answers.response[kept], second=answers.second[kept])
    here = fit_planes(less, "normal", 0.0, 0.0, middle=0.5).pooled["all"]
    expected = fit_plane(counted_points(less.x, answers.second[kept], less.response), middle=0.5)
    assert here.threshold == pytest.approx(expected.threshold, rel=1e-6)
    assert here.threshold != pytest.approx(fit_planes(less, "normal", 0.0, 0.0).pooled["all"].threshold)


def test_a_falling_function_is_the_rising_one_of_the_other_answers() -> None:
    rising = points("yes_no")
    turned = fit_plane(rising._replace(k=rising.n - rising.k), falling=True)
    fit = fit_plane(rising)
    for what in ("threshold", "tilt", "spread", "threshold_se"):
        assert getattr(turned, what) == pytest.approx(getattr(fit, what), rel=1e-6)
    assert turned.tilt_ci.low == pytest.approx(fit.tilt_ci.low, rel=1e-6)


def test_data_that_place_no_threshold_are_refused() -> None:
    x, z = (axis.ravel() for axis in np.meshgrid([1.0, 2.0, 3.0, 4.0], [0.0, 1.0]))
    n, some = np.full(8, 4.0), np.tile([0.0, 1.0, 3.0, 4.0], 2)
    for one, said in (
        (Points(x, z, n, n), "all 32 answers are the same"),
        (Points(x, np.zeros(8), n, some), "two numbers of the second variable or more, got 1"),
        (Points(np.ones(8), z, n, some), "two numbers of x or more, got 1"),
        (Points(x, z, n, 4.0 - some), "do not change with x in the expected direction, so"),
        (Points(x, z, n, np.where(x > 2.5, 4.0, 0.0)), "switch between stimuli without overlap"),
    ):
        with pytest.raises(InputError, match=re.escape(said)):
            fit_plane(one)


def people_file(folder: Path) -> Path:
    rng = np.random.default_rng(4)
    rows = ["person,duration,asymmetry,seen"]
    for person in range(5):
        own = 320 + 20 * rng.standard_normal()
        for _ in range(160):
            x, z = rng.choice([100, 200, 300, 400, 500]), rng.choice([0.0, 0.5, 1.0])
            rows.append(
                f"P{person},{x},{z},{int(x - own - 150 * (z - 0.5) + 60 * rng.standard_normal() > 0)}"
            )
    (folder / "trials.csv").write_text("\n".join(rows) + "\n")
    return folder / "trials.csv"


def test_the_command_fits_people_and_their_means(tmp_path: Path) -> None:
    file, out = people_file(tmp_path), tmp_path / "out.json"
    options = ["--x", "duration", "--second", "asymmetry", "--response", "seen", "--participant", "person"]
    done = CliRunner().invoke(app, ["thresholds", str(file), *options, "--json", str(out)])
    assert done.exit_code == 0, done.output
    answer = json.loads(out.read_text())
    means = answer["means"]["all"]
    assert means["threshold"]["people"] == 5
    assert means["threshold"]["ci_low"] < 320 < means["threshold"]["ci_high"]
    assert means["tilt"]["ci_low"] < 150 < means["tilt"]["ci_high"]
    assert "varies linearly with asymmetry" in " ".join(done.output.split())
    assert "Threshold along asymmetry" in done.output


@pytest.mark.parametrize("falling", [False, True])
def test_a_plane_with_a_guess_rate_says_that_its_function_falls(tmp_path: Path, falling: bool) -> None:
    rows, rng = ["duration,asymmetry,correct"], np.random.default_rng(4)
    for _ in range(500):
        x, z = rng.uniform(200, 440), rng.uniform(0, 1)
        chance = 0.5 + 0.5 / (1 + np.exp(-(x - 320 - 80 * (z - 0.5)) / 25 * (-1 if falling else 1)))
        rows.append(f"{x:.0f},{z:.2f},{int(rng.uniform() < chance)}")
    file = tmp_path / "trials.csv"
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    options = ["--x", "duration", "--second", "asymmetry", "--response", "correct", "--guess", "0.5"]
    done = CliRunner().invoke(app, ["thresholds", str(file), *options])
    assert done.exit_code == 0, done.output
    said = "correct answers become rarer as x increases: the function falls."
    assert (said in " ".join(done.output.split())) == falling


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--second", "nothing"], "nothing"),
        (["--second", "asymmetry", "--function", "weibull"], "--second needs --function normal or logistic"),
        (["--second", "asymmetry", "--lapse", "fit"], "--second needs --lapse as a number"),
        (["--second", "duration"], "duration"),
    ],
)
def test_what_cannot_be_fitted_is_said_in_one_line(options: list[str], said: str) -> None:
    file = str(FOLDER / "yes_no.csv")
    done = CliRunner().invoke(app, ["thresholds", file, "--x", "duration", "--response", "seen", *options])
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)
