"""Residual checks: modes against a dense solution, the level under the model, and faults that are found."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.models.residuals import ResidualChecks
from experiments.errors import InputError


def ratings(seed: int, people: int = 15, clips: int = 12, noise: str = "normal") -> pd.DataFrame:
    """Ratings of people crossed with clips, of two conditions; `noise` is that of single ratings."""
    random = np.random.default_rng(seed)
    person, clip = (grid.ravel() for grid in np.meshgrid(np.arange(people), np.arange(clips)))
    condition = clip % 2
    eta = 0.4 * random.normal(size=people)[person] + 0.3 * random.normal(size=clips)[clip] + 0.5 * condition
    error = random.normal(size=len(person))
    if noise == "skewed":
        error = random.exponential(size=len(person)) - 1
    elif noise == "spreading":
        error *= np.where(condition == 1, 2.0, 0.5)
    elif noise == "outliers":
        error[random.integers(len(person), size=4)] += 8
    columns = {"id": person, "clip": clip, "kind": np.where(condition, "b", "a"), "score": eta + error}
    return pd.DataFrame(columns).astype({"id": str, "clip": str})


def checks_of(rows: pd.DataFrame) -> ResidualChecks:
    result = fit_mixed(rows, "id", "score", ["kind"], "clip", "none", residuals=True)
    assert result.residuals is not None
    return result.residuals


def p_values(checks: ResidualChecks) -> dict[str, float]:
    return {test.name.split(" ")[0]: test.p_value for test in checks.tests}


def test_fitted_values_are_the_best_linear_predictions() -> None:
    """By the covariance of the ratings itself: X b + (V - sigma^2 I) V^-1 (y - X b), b by least squares."""
    rows = ratings(1)
    result = fit_mixed(rows, "id", "score", ["kind"], "clip", "none", residuals=True)
    checks = result.residuals
    assert checks is not None
    sd = {component.group: component.sd for component in result.components}
    same = {name: np.equal.outer(rows[name].to_numpy(), rows[name].to_numpy()) for name in ("id", "clip")}
    n = len(rows)
    v = sum(sd[name] ** 2 * same[name] for name in same) + sd["residual"] ** 2 * np.eye(n)
    x = np.column_stack([np.ones(n), np.where(rows["kind"] == "a", 1.0, -1.0)])
    y, inverse = rows["score"].to_numpy(), np.linalg.inv(v)
    fixed = x @ np.linalg.solve(x.T @ inverse @ x, x.T @ inverse @ y)
    fitted = fixed + (v - sd["residual"] ** 2 * np.eye(n)) @ inverse @ (y - fixed)
    assert checks.fitted == pytest.approx(fitted, abs=1e-7)
    assert checks.residuals == pytest.approx((y - fitted) / sd["residual"], abs=1e-6)


def test_checks_hold_their_level_where_the_model_holds() -> None:
    """80 data sets: more than 9 of 80 below .05 has p = .02, although people and clips repeat."""
    found = [p_values(checks_of(ratings(seed, people=8, clips=8))) for seed in range(80)]
    for name in ("uniformity", "largest", "spread"):
        assert sum(p[name] <= 0.05 for p in found) <= 9, name
    assert sum(p["uniformity"] <= 0.5 for p in found) > 20


@pytest.mark.parametrize(
    ("noise", "check"), [("skewed", "uniformity"), ("spreading", "spread"), ("outliers", "largest")]
)
def test_faults_are_found(noise: str, check: str) -> None:
    assert p_values(checks_of(ratings(3, people=20, clips=20, noise=noise)))[check] <= 0.01


def test_ordinal_residuals_are_drawn_within_their_category() -> None:
    rows = ratings(5, people=20, clips=16)
    rows["score"] = np.clip(np.rint(rows["score"] * 1.2 + 3), 1, 5)
    result = fit_ordinal(rows, "id", "score", ["kind"], "clip", residuals=True)
    checks = result.residuals
    assert checks is not None
    assert min(p_values(checks).values()) > 0.01
    edges = np.concatenate([[-np.inf], result.thresholds, [np.inf]])
    code = np.unique(rows["score"], return_inverse=True)[1]
    # the logistic's quantile at the drawn probability lies between the category's thresholds
    from scipy import special

    drawn = special.logit(special.ndtr(np.array(checks.residuals))) + np.array(checks.fitted)
    assert np.all((drawn > edges[code] - 1e-6) & (drawn < edges[code + 1] + 1e-6))
    assert abs(np.mean(checks.residuals)) < 0.15


def test_command_writes_a_figure_and_the_points(tmp_path: Path) -> None:
    path, out, figure = tmp_path / "r.csv", tmp_path / "r.json", tmp_path / "r.png"
    ratings(1).to_csv(path, index=False)
    base = ["mixed", str(path), "--formula", "score ~ kind + (1 | id) + (1 | clip)", "--json", str(out)]
    result = CliRunner().invoke(app, [*base, "--residuals", str(figure)])
    assert result.exit_code == 0, result.exception
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "uniformity (KS distance)" in result.stdout
    written = json.loads(out.read_text())["residuals"]
    assert len(written["scaled"]) == len(written["fitted"]) == 180
    assert CliRunner().invoke(app, [*base, "--residuals", str(tmp_path / "r.svg")]).exit_code == 0
    assert "<svg" in (tmp_path / "r.svg").read_text()[:400]
    wrong = CliRunner().invoke(app, [*base, "--residuals", str(tmp_path / "r.txt")])
    assert isinstance(wrong.exception, InputError)
