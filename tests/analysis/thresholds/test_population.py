"""Thresholds over people: against glmer, brute force, and on bad input."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import special

from analysis.thresholds.answers import Answers, count_trials
from analysis.thresholds.likelihood import Trials
from analysis.thresholds.people import PopulationLikelihood, fit_population, fit_thresholds, with_population
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
ROWS = pd.read_csv(GOLDEN / "population.csv")
TRIALS = [count_trials(g["x"].to_numpy(), g["y"].to_numpy(float)) for _, g in ROWS.groupby("id")]


def test_with_one_spread_it_is_glmer() -> None:
    theirs = json.loads((GOLDEN / "population.json").read_text(encoding="utf-8"))
    model = PopulationLikelihood(TRIALS, "normal", 0.0, 0.0, falling=False)
    at = [theirs["threshold"], np.log(theirs["threshold_sd"]), np.log(theirs["spread"]), -14.0]
    assert model.value(np.array(at)) == pytest.approx(theirs["log_likelihood"], abs=1e-7)


def test_estimates_where_the_spread_is_the_same() -> None:
    theirs = json.loads((GOLDEN / "population.json").read_text(encoding="utf-8"))
    fit = fit_population(TRIALS, "normal", 0.0, 0.0, falling=False)
    assert fit.log_likelihood == pytest.approx(theirs["log_likelihood"], abs=1e-5)
    for key in ("threshold", "threshold_sd", "spread"):
        assert getattr(fit, key) == pytest.approx(theirs[key], rel=1e-3), key
    assert fit.threshold_ci.low is not None
    assert fit.threshold_ci.low < fit.threshold - fit.threshold_se


def test_the_integral_by_brute_force() -> None:
    """One person's likelihood over a fine grid of threshold and log spread, with guesses and lapses."""
    x, n, k = np.array([1.0, 3.0, 5.0, 9.0]), np.full(4, 10.0), np.array([5.0, 7.0, 8.0, 10.0])
    values = np.array([4.0, np.log(1.5), 0.4, np.log(0.6)])
    model = PopulationLikelihood([Trials(x, n, k)], "logistic", 0.5, 0.02, falling=False)
    u = np.linspace(-9, 9, 1201)
    a, log_b = values[0] + 1.5 * u, values[2] + 0.6 * u
    p = 0.5 + 0.48 * special.expit((x - a[:, None, None]) / np.exp(log_b)[:, None])
    log_joint = (k * np.log(p) + (n - k) * np.log1p(-p)).sum(axis=-1) - (u[:, None] ** 2 + u**2) / 2
    whole = special.logsumexp(log_joint) + 2 * np.log(u[1] - u[0]) - np.log(2 * np.pi)
    assert model.value(values) == pytest.approx(whole, abs=2e-4)


@pytest.mark.parametrize(
    ("shape", "lapse", "named", "said"),
    [
        ("weibull", 0.0, True, "--function normal or logistic"),
        ("normal", None, True, "holds the lapse rate"),
        ("normal", 0.0, False, "needs --participant"),
    ],
)
def test_bad_input_is_one_clear_line(shape, lapse, named, said) -> None:
    who = ROWS["id"].astype(object).to_numpy() if named else None
    answers = Answers(
        ROWS["x"].to_numpy(),
        ROWS["y"].to_numpy(float),
        who,
        None,
        "trials.csv",
        synthetic=False,
        decisions=(),
    )
    pooled = fit_thresholds(
        Answers(answers.x, answers.response, None, None, "trials.csv", synthetic=False, decisions=()),
        "normal",
        0.0,
        0.0,
    )
    with pytest.raises(InputError, match=said):
        with_population(pooled, answers, shape, 0.0, lapse)
