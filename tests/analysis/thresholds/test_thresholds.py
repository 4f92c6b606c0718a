"""Psychometric functions against R (tests/golden/r/thresholds.R), and refusals in one line."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, special
from typer.testing import CliRunner

from analysis.cli import app
from analysis.thresholds.answers import Answers, count_trials, read_answers
from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import PersonThreshold, fit_thresholds, mean_threshold
from analysis.thresholds.psychometric import Threshold, fit_threshold
from experiments.errors import InputError

FOLDER = Path(__file__).parents[2] / "golden/r/thresholds"
REFERENCE: dict[str, Any] = json.loads((FOLDER / "reference.json").read_text(encoding="utf-8"))


def trials(name: str) -> Trials:
    answers = read_answers(FOLDER / f"{name}.csv", "duration", "seen")
    return count_trials(answers.x, answers.response)


@pytest.mark.parametrize(
    ("key", "table", "shape", "guess", "lapse"),
    [
        ("yes_no", "yes_no", "normal", 0.0, 0.0),
        ("two_afc", "two_afc", "weibull", 0.5, 0.0),
        ("two_afc_lapse", "two_afc", "weibull", 0.5, None),
        ("logistic_lapse", "logistic", "logistic", 0.0, None),
    ],
)
def test_fits_equal_r(key: str, table: str, shape: Any, guess: float, lapse: float | None) -> None:
    fit, expected = fit_threshold(trials(table), shape, guess, lapse), REFERENCE[key]
    assert fit.log_likelihood == pytest.approx(expected["logLik"], abs=1e-6)
    assert fit.threshold == pytest.approx(expected["threshold"], rel=1e-5)
    assert fit.spread == pytest.approx(expected["spread"], rel=1e-4)
    assert fit.lapse == pytest.approx(expected["lapse"], abs=1e-5)
    assert fit.threshold_ci.low == pytest.approx(expected["low"], rel=1e-4)
    assert fit.threshold_ci.high == pytest.approx(expected["high"], rel=1e-4)


def test_probit_equals_glm_with_its_standard_error() -> None:
    fit, expected = fit_threshold(trials("yes_no")), REFERENCE["glm"]
    assert fit.threshold == pytest.approx(expected["threshold"], rel=1e-6)
    assert fit.spread == pytest.approx(expected["spread"], rel=1e-6)
    # glm takes the expected information, here the observed one is taken.
    assert fit.threshold_se == pytest.approx(expected["se"], rel=5e-4)
    assert fit.log_likelihood == pytest.approx(expected["logLik"], abs=1e-8)
    assert fit.x75 == pytest.approx(fit.threshold + 0.6744897501960817 * fit.spread)


@settings(max_examples=5, deadline=None)
@given(st.floats(-50, 50), st.floats(0.1, 100))
def test_the_unit_of_x_does_not_matter(shift: float, scale: float) -> None:
    data = trials("yes_no")
    first = fit_threshold(data, intervals=False)
    moved = fit_threshold(Trials(shift + scale * data.x, data.n, data.k), intervals=False)
    assert moved.threshold == pytest.approx(shift + scale * first.threshold, rel=1e-5, abs=1e-4)
    assert moved.log_likelihood == pytest.approx(first.log_likelihood, abs=1e-6)


def test_a_falling_function_is_the_rising_one_of_the_other_answer() -> None:
    data = trials("yes_no")
    rising, falling = fit_threshold(data), fit_threshold(Trials(data.x, data.n, data.n - data.k))
    assert falling.falling
    assert falling.threshold == pytest.approx(rising.threshold, rel=1e-6)
    assert falling.slope == pytest.approx(-rising.slope, rel=1e-5)


def test_correct_answers_that_become_rarer_are_fitted_as_the_mirrored_ones() -> None:
    """With a guess rate, too, the answers say whether the function falls: x may be a blur."""
    x = np.linspace(-3, 3, 9)
    n, k = np.full(9, 40.0), np.array([40.0, 39, 36, 34, 28, 30, 22, 24, 21])
    falling = fit_threshold(Trials(x, n, k), guess=0.5, lapse=None)
    rising = fit_threshold(Trials(-x[::-1], n, k[::-1]), guess=0.5, lapse=None)
    assert falling.falling
    assert not rising.falling
    assert falling.threshold == pytest.approx(-rising.threshold, rel=1e-5)
    assert falling.spread == pytest.approx(rising.spread, rel=1e-5)
    assert falling.log_likelihood == pytest.approx(rising.log_likelihood, abs=1e-8)
    assert any("the function falls" in note for note in falling.notes)


def test_a_person_is_fitted_in_the_direction_of_all() -> None:
    """One person's exchanged keys, or few answers, do not turn the function around for that person."""
    x, share = np.arange(1.0, 6.0), np.array([1, 3, 10, 16, 19])
    up = np.concatenate([np.repeat([1.0, 0.0], [k, 20 - k]) for k in share])
    answered = np.concatenate([up, up, up, 1 - up])
    names = np.repeat(["a", "b", "c", "exchanged"], 100).astype(object)
    answers = Answers(np.tile(np.repeat(x, 20), 4), answered, names, None, "trials.csv", False, ())
    result = fit_thresholds(answers, "normal", 0.0, 0.0)
    fits = {one.participant: one.fit for one in result.people}
    other = fits["exchanged"]
    assert other is not None
    assert not other.falling
    assert any("hardly change" in note for note in other.notes)
    assert result.means[0].mean == pytest.approx(fits["a"].threshold, rel=1e-3)


def test_a_condition_at_chance_does_not_fall_where_others_rise() -> None:
    """Where half is right by guessing, the answers of a hard condition fall as often as they rise."""
    x = np.arange(1.0, 6.0)
    shares = {"easy": [12, 14, 17, 19, 20], "hard": [12, 10, 11, 10, 11], "middle": [11, 12, 13, 16, 18]}
    answered = np.concatenate([np.repeat([1.0, 0.0], [k, 20 - k]) for own in shares.values() for k in own])
    condition = np.repeat(list(shares), 100).astype(object)
    answers = Answers(np.tile(np.repeat(x, 20), 3), answered, None, condition, "trials.csv", False, ())
    assert fit_threshold(Trials(x, np.full(5, 20.0), np.array(shares["hard"], float)), guess=0.5).falling
    with pytest.raises(InputError, match=r"trials.csv \(hard\): .* the answers hardly change with x"):
        fit_thresholds(answers, "normal", 0.5, 0.0)
    others = condition != "hard"
    for sign, falls in ((1, False), (-1, True)):
        kept = replace(
            answers, x=sign * answers.x[others], response=answered[others], condition=condition[others]
        )
        fits = fit_thresholds(kept, "normal", 0.5, 0.0).pooled
        assert [fit.falling for fit in fits.values()] == [falls, falls]
        assert all(any("the function falls" in note for note in fit.notes) == falls for fit in fits.values())


def test_answers_that_switch_at_once_are_said_so() -> None:
    fit = fit_threshold(Trials(np.array([1.0, 2.0, 3.0, 4.0]), np.full(4, 10.0), np.array([0.0, 0, 10, 10])))
    assert 2 <= fit.threshold <= 3
    assert any("switch between two levels" in note for note in fit.notes)
    assert fit.spread_ci.low is None


def test_the_mean_over_people_weighs_by_precision() -> None:
    def person(threshold: float, se: float) -> PersonThreshold:
        fit = fit_threshold(trials("yes_no"), intervals=False)
        changed = {**vars(fit), "threshold": threshold, "threshold_se": se}
        return PersonThreshold(str(threshold), "all", Threshold(**changed), "")

    equal = mean_threshold([person(1.0, 0.1), person(3.0, 0.1)], "all")
    assert equal is not None
    assert equal.mean == pytest.approx(2.0)
    assert equal.tau == pytest.approx(np.sqrt(2 - 0.01), rel=1e-3)  # sample variance 2 less the error's
    same = mean_threshold([person(2.0, 0.1), person(2.001, 10.0)], "all")
    assert same is not None
    assert same.tau == pytest.approx(0.0, abs=1e-3)
    assert same.mean == pytest.approx(2.0, abs=1e-4)


def test_people_who_all_change_at_one_level_give_the_mean_no_interval(tmp_path: Path) -> None:
    # Hartung and Knapp's error is the spread of the estimates: 0, whatever the single people's intervals are.
    lines = ["id,x,yes"]
    lines += [f"p{p},{x},{int(x > 3)}" for p in range(8) for x in (1, 2, 3, 4, 5) for _ in range(10)]
    file, out = tmp_path / "same.csv", tmp_path / "same.json"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    named = ["thresholds", str(file), "--participant", "id", "--x", "x", "--response", "yes"]
    ended = CliRunner().invoke(app, [*named, "--json", str(out)])
    assert ended.exit_code == 0, ended.output
    said = " ".join(ended.output.split())
    assert "all: all 8 people have the same threshold, so the mean has no standard error." in said
    (mean,) = json.loads(out.read_text(encoding="utf-8"))["means"]
    assert (mean["se"], mean["ci_low"], mean["ci_high"]) == (None, None, None)
    assert mean["mean"] == pytest.approx(3.5, abs=0.02)


def test_the_command_writes_pooled_people_and_means(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = [
        f"{person:02d},{x},{'yes' if rng.random() < 1 / (1 + np.exp(-(x - 5 - person / 5) / 0.8)) else 'no'}"
        for person in range(4)
        for x in (2, 4, 5, 6, 8)
        for _ in range(12)
    ]
    path, out = tmp_path / "trials.csv", tmp_path / "out.json"
    path.write_text("id,x,response\n" + "\n".join(rows) + "\n")
    done = CliRunner().invoke(app, ["thresholds", str(path), "--participant", "id", "--json", str(out)])
    assert done.exit_code == 0, done.output
    told = json.loads(out.read_text())
    assert told["pooled"]["all"]["threshold"] == pytest.approx(5.3, abs=0.6)
    assert [one["participant"] for one in told["people"]] == ["00", "01", "02", "03"]
    assert told["means"][0]["people"] == 4
    assert done.output.index("mean over people") < done.output.index("over all trials")


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        ("x,response\n1,1\n1,0\n", [], "two levels of x or more, got 1"),
        ("x,response\n1,1\n2,1\n", [], "all 2 answers are the same"),
        ("x,response\n1,maybe\n2,1\n", [], "'response' is 'maybe' in line 2. Expected 1 or 0"),
        ("x,response\nlong,0\n2,1\n", [], "'x' should be a number, got 'long'"),
        ("x,response\n0,0\n2,1\n", ["--function", "weibull"], "Weibull function needs x above 0"),
        ("x,response\n1,0\n2,1\n", ["--guess", "1.5"], "expected --guess from 0"),
        ("x,response\n1,0\n2,1\n", ["--lapse", "much"], "expected --lapse as a number"),
        ("x,response\n1,0\n", ["--x", "y"], "has no column 'y'"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, text: str, options: list[str], told: str) -> None:
    path = tmp_path / "trials.csv"
    path.write_text(text)
    done = CliRunner().invoke(app, ["thresholds", str(path), *options])
    assert isinstance(done.exception, InputError)
    assert told in str(done.exception)


def test_people_without_a_threshold_of_their_own_are_counted_next_to_the_mean(tmp_path: Path) -> None:
    path = tmp_path / "trials.csv"
    rows = [f"p{p},{x},{int(k < (x - p) / 4)}" for p in range(4) for x in (10, 20, 30, 40) for k in range(10)]
    rows += [f"q,{x},1" for x in (10, 20, 30, 40) for _ in range(10)]
    path.write_text("\n".join(["id,x,r", *rows]))
    call = ["thresholds", str(path), "--x", "x", "--response", "r", "--participant", "id"]
    done = CliRunner().invoke(app, call)
    said = " ".join(done.output.split())
    assert "all: 1 of 5 people have no individual threshold and are not in the mean. The mean" in said
    path.write_text("\n".join(["id,x,r", *rows[:160]]))
    assert "no individual threshold" not in CliRunner().invoke(app, call).output


def test_answers_rarer_than_guessing_gives_are_named() -> None:
    x, n = np.array([20.0, 40, 60, 80]), np.full(4, 32.0)
    trials = Trials(x, n, np.array([2.0, 10, 24, 31]))
    (said,) = fit_threshold(trials, "normal", 0.5, 0.0).notes
    assert said.startswith("at 20 2 of 32 answers are yes, fewer than expected from a guess rate of 0.5")
    assert not fit_threshold(trials, "normal", 0.05, 0.0).notes
    assert not fit_threshold(Trials(x, n, np.array([12.0, 18, 27, 31])), "normal", 0.5, 0.0).notes


@pytest.mark.parametrize(("n", "k"), [([13, 20, 10, 17], [1, 0, 5, 17]), ([12, 14, 19, 15], [0, 1, 8, 15])])
def test_where_slopes_grow_without_end_the_error_is_that_of_the_profile(n: list[int], k: list[int]) -> None:
    """The curvature on such a ridge gave no error, or 68 for an interval of half a unit: people were lost."""
    steep = Trials(np.arange(4.0), np.array(n, float), np.array(k, float))
    fit = fit_threshold(steep, "normal", 0.02, 0.02)
    assert fit.threshold_se is not None
    assert fit.threshold_ci.low is not None
    assert fit.threshold_ci.high is not None
    width = fit.threshold_ci.high - fit.threshold_ci.low
    assert fit.threshold_se == pytest.approx(width / (2 * 1.959964), rel=0.05)
    mean = mean_threshold([PersonThreshold(name, "all", fit, "") for name in "ab"], "all")
    assert mean is not None
    assert mean.people == 2


@pytest.mark.parametrize(("k", "lapse"), [([0, 2, 6, 11, 16, 19, 20], 0.0), ([0, 2, 6, 11, 15, 16, 16], 0.1)])
def test_at_an_end_of_the_lapse_rate_the_error_is_that_of_the_profile(k: list[int], lapse: float) -> None:
    """There the likelihood is cut off, and its curvature is not an error: ordinary people were left out."""
    fit = fit_threshold(Trials(np.arange(1.0, 8), np.full(7, 20.0), np.array(k, float)), "normal", 0.0, None)
    assert fit.lapse == pytest.approx(lapse, abs=1e-8)
    assert fit.threshold_ci.low is not None
    assert fit.threshold_ci.high is not None
    width = fit.threshold_ci.high - fit.threshold_ci.low
    assert fit.threshold_se == pytest.approx(width / (2 * 1.959964), rel=1e-6)


@pytest.mark.parametrize(("unit", "decimals"), [(1000.0, 0), (1.0, 2), (0.001, 5)])
def test_thresholds_have_the_decimals_that_their_error_supports(
    tmp_path: Path, unit: float, decimals: int
) -> None:
    shares = {1.0: 3, 2.0: 9, 3.0: 21, 4.0: 33, 5.0: 38}
    lines = [f"{x * unit!r},{int(i < k)}" for x, k in shares.items() for i in range(40)]
    (tmp_path / "t.csv").write_text("\n".join(["x,response", *lines]) + "\n")
    result = CliRunner().invoke(app, ["thresholds", str(tmp_path / "t.csv"), "--x", "x"])
    (row,) = (line.split() for line in result.output.splitlines() if line.startswith("all "))
    assert {len(cell.strip("[],").partition(".")[2]) for cell in row[1:6]} == {decimals}, row
    assert float(row[1]) == pytest.approx(2.89 * unit, rel=0.01)


@pytest.mark.parametrize("guess", [0.0, 0.5])
def test_stimuli_without_repeats_bound_the_slope_and_say_nothing_of_the_fit(guess: float) -> None:
    """The spread is that of a second optimizer, and its profile interval is finite."""
    rng = np.random.default_rng(3)
    x = np.linspace(-10, 10, 200)
    k = (rng.uniform(size=200) < guess + (1 - guess) * special.ndtr((x - 0.5) / 3)).astype(float)
    fit = fit_threshold(Trials(x, np.ones(200), k), "normal", guess, 0.0)

    def negative(values: np.ndarray) -> float:
        p = guess + (1 - guess) * special.ndtr((x - values[0]) / np.exp(values[1]))
        return -float(special.xlogy(k, p).sum() + special.xlogy(1 - k, 1 - p).sum())

    free = optimize.minimize(
        negative, [0.0, 1.0], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-10}
    )
    assert fit.threshold == pytest.approx(free.x[0], abs=1e-4)
    assert fit.spread == pytest.approx(np.exp(free.x[1]), rel=1e-4)
    assert fit.spread_ci.low is not None
    assert fit.spread_ci.high is not None
    assert not any("upper limit" in note for note in fit.notes)
    assert np.isnan(fit.p)
    assert any("no fit p" in note for note in fit.notes)


@pytest.mark.parametrize(
    ("x", "k", "is_step"),
    [
        ([1, 2, 3, 4, 5, 6], [0, 0, 0, 1, 1, 1], True),
        ([1, 2, 3, 4, 5, 6], [0, 0, 1, 0, 1, 1], False),
        ([1, 2, 3, 4, 5, 6], [1, 1, 1, 0, 0, 0], True),
    ],
)
def test_only_answers_that_change_once_leave_the_slope_without_a_limit(x, k, is_step) -> None:
    fit = fit_threshold(Trials(np.array(x, float), np.ones(6), np.array(k, float)), "normal", 0.0, 0.0)
    assert any("no upper limit" in note for note in fit.notes) is is_step
    assert (fit.spread_ci.low is None) is is_step
