"""Bayes factors of repeated measures: published, by dense matrices, and by another integral of pairs."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate, special, stats
from typer.testing import CliRunner

from analysis.cli import app
from analysis.within.anova import within_anova
from analysis.within.bayes import BayesAnova, bayes_anova
from experiments.errors import InputError

# Student's sleep data, as R ships them: extra hours of ten people under two drugs.
SLEEP = np.array(
    [
        [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0],
        [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4],
    ]
).T


def test_sleep_has_the_published_bayes_factor() -> None:
    """The help page of BayesFactor's anovaBF: "a Bayes factor of about 11.6"."""
    result = bayes_anova(within_anova(SLEEP, ["drug"]))
    assert result.effects[0].bf_inclusion == pytest.approx(11.6, abs=0.1)
    assert result.models[0].log_bf10 == pytest.approx(np.log(result.effects[0].bf_inclusion))


def made(people: int = 8) -> np.ndarray:
    """Cell means of a 2 x 3 design; people differ in the first effect."""
    random = np.random.default_rng(3)
    y = random.normal(size=(people, 1, 1)) + 0.3 * random.normal(size=(people, 2, 3))
    y = y + 0.8 * np.array([-1, 1])[:, None] * (1 + 0.4 * random.normal(size=(people, 1, 1)))
    return y + 0.3 * np.array([-1, 0, 1])


def dense_log_likelihood(y: np.ndarray, columns: list[np.ndarray], g: list[float]) -> float:
    """Rouder et al. (2012), equation for one set of g: all coefficients integrated, by plain matrices."""
    z = np.hstack([np.sqrt(one) * part for one, part in zip(g, columns, strict=True)])
    z, values = z - z.mean(axis=0), y - y.mean()
    inner = np.eye(z.shape[1]) + z.T @ z
    residual = values @ values - values @ z @ np.linalg.solve(inner, z.T @ values)
    return -np.linalg.slogdet(inner)[1] / 2 - (len(y) - 1) / 2 * np.log(residual)


@pytest.mark.parametrize("slopes", [False, True])
def test_models_are_the_average_over_draws_of_their_priors(slopes: bool) -> None:
    """Quasi Monte Carlo over the variances, where the module integrates on grids of precisions."""
    y = made()
    people = len(y)
    basis = {2: np.array([[1], [-1]]) / np.sqrt(2), 3: np.array([[1, 1], [-1, 1], [0, -2]]) / np.sqrt([2, 6])}
    of_cells = {
        "A": np.kron(basis[2], np.ones((3, 1))),
        "B": np.kron(np.ones((2, 1)), basis[3]),
        "A:B": np.kron(basis[2], basis[3]),
    }
    base = [(np.kron(np.eye(people), np.ones((6, 1))), 1.0)]
    if slopes:
        base += [(np.kron(np.eye(people), of_cells[name]), 1.0) for name in ("A", "B")]

    def log_mean(effects: tuple[str, ...]) -> float:
        parts = [*base, *((np.kron(np.ones((people, 1)), of_cells[name]), 0.5) for name in effects)]
        uniform = np.clip(stats.qmc.Sobol(len(parts), seed=1).random(2**12), 1e-9, 1 - 1e-9)
        g = [stats.invgamma.ppf(u, 0.5, scale=r**2 / 2) for u, (_, r) in zip(uniform.T, parts, strict=True)]
        columns = [part for part, _ in parts]
        logs = [dense_log_likelihood(y.ravel(), columns, list(one)) for one in zip(*g, strict=True)]
        return float(special.logsumexp(logs)) - np.log(len(logs))

    null = log_mean(())
    for model in bayes_anova(within_anova(y, ["A", "B"]), slopes).models:
        assert model.log_bf10 == pytest.approx(log_mean(model.effects) - null, abs=0.15), model.effects


def test_two_levels_of_people_who_differ_widely_are_a_test_of_differences() -> None:
    """Of many people whose means differ widely, only differences say something of the effect.

    Differences d have the variance 2 sigma^2 and the mean sqrt(2) b, b the coefficient of the orthonormal
    contrast: a Cauchy prior of b / sigma with scale 0.5 is one of the standardized difference with scale 0.5.
    The tail of the prior of the participants' variance, g^-3/2, takes one df more than their means: the power
    of the t test's likelihood is (N - 1) / 2, not N / 2.
    """
    random = np.random.default_rng(6)
    people = 60
    y = 1e3 * random.normal(size=(people, 1)) + random.normal(size=(people, 2)) + [0.0, 0.4]
    t = float(stats.ttest_rel(y[:, 1], y[:, 0]).statistic)

    def over_g(g: float) -> float:
        prior = 0.5 / np.sqrt(2 * np.pi) * g**-1.5 * np.exp(-0.125 / g)
        shrunk = 1 + people * g
        return prior * shrunk**-0.5 * (1 + t**2 / (shrunk * (people - 1))) ** (-(people - 1) / 2)

    value = integrate.quad(over_g, 0, 1)[0] + integrate.quad(over_g, 1, np.inf)[0]
    expected = value / (1 + t**2 / (people - 1)) ** (-(people - 1) / 2)
    assert bayes_anova(within_anova(y, ["A"])).effects[0].bf_inclusion == pytest.approx(expected, rel=1e-3)


def test_units_and_order_of_levels_change_nothing() -> None:
    def logs(result: BayesAnova) -> list[float]:
        return [effect.log_bf_inclusion for effect in result.effects]

    y = made()
    expected = logs(bayes_anova(within_anova(y, ["A", "B"])))
    assert logs(bayes_anova(within_anova(1e4 * y - 7e5, ["A", "B"]))) == pytest.approx(expected, abs=1e-5)
    assert logs(bayes_anova(within_anova(y[:, :, [2, 0, 1]], ["A", "B"]))) == pytest.approx(expected)


def test_only_models_with_the_parts_of_interactions_are_compared() -> None:
    y = np.random.default_rng(1).normal(size=(9, 2, 2, 2))
    result = bayes_anova(within_anova(y, ["A", "B", "C"]))
    assert len(result.models) == 19
    for model in result.models:
        for effect, other in product(model.effects, "ABC"):
            assert other not in effect.split(":") or other in model.effects


def test_what_has_no_bayes_factor_is_one_line(tmp_path: Path) -> None:
    y = np.random.default_rng(1).normal(size=(4, 1)) + np.array([[0.0, 1.0]])
    with pytest.raises(InputError, match="no residual is left"):
        bayes_anova(within_anova(y, ["A"]))
    path, out = tmp_path / "r.csv", tmp_path / "r.json"
    rows = [f"{p},{k % 2},{d},{value}" for (p, d), value in np.ndenumerate(SLEEP) for k in [p]]
    path.write_text("\n".join(["id,group,drug,extra", *rows]) + "\n", encoding="utf-8")
    base = ["anova", str(path), "--participant", "id", "--rating", "extra", "--within", "drug", "--bayes"]
    result = CliRunner().invoke(app, [*base, "--json", str(out)])
    assert result.exit_code == 0, result.exception
    assert "Bayes factors of effects" in result.stdout
    assert json.loads(out.read_text())["bayes"]["effects"][0]["bf_inclusion"] == pytest.approx(
        11.68, abs=0.01
    )
    refused = CliRunner().invoke(app, [*base, "--between", "group"])
    assert "--bayes is for factors within participants" in str(refused.exception)
