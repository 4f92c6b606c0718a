"""The ordinal model by quadrature against clmm with nAGQ (golden), against integrals, and on bad input."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, special

from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from analysis.models.ordinal import fit_ordinal
from analysis.models.ordinal_maximum import QuadratureLikelihood
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
FITS = json.loads((GOLDEN / "quadrature.json").read_text(encoding="utf-8"))["fits"]


@pytest.mark.parametrize("fit", FITS, ids=lambda fit: f"{fit['name']}-{fit['nodes']}")
def test_agrees_with_clmm(fit) -> None:
    """clmm stops a little below the maximum where people lie far apart."""
    rows = pd.read_csv(GOLDEN / "models" / f"{fit['name']}.csv")
    ours = fit_ordinal(
        rows, "participant", "rating", [name for name in "AB" if name in rows], quadrature=fit["nodes"]
    )
    assert ours.quadrature == fit["nodes"]
    assert ours.log_likelihood == pytest.approx(fit["log_likelihood"], abs=2e-6)
    assert ours.sd_participant == pytest.approx(fit["sd_participant"], rel=1e-4)
    assert ours.thresholds == pytest.approx(fit["thresholds"], rel=1e-4, abs=5e-5)
    assert [c.estimate for c in ours.coefficients] == pytest.approx(fit["coefficients"], rel=1e-4, abs=1e-5)
    assert [c.se for c in ours.coefficients] == pytest.approx(fit["standard_errors"], rel=1e-4)


@pytest.fixture(scope="module")
def small() -> OrdinalData:
    rng = np.random.default_rng(4)
    participant = np.repeat(np.arange(5), 6)
    x = rng.choice([-1.0, 1.0], (30, 1))
    score = 0.8 * x[:, 0] + rng.normal(0, 1, 5)[participant] + rng.logistic(size=30)
    zeros = np.zeros(30, np.int64)
    category = np.searchsorted([-1.0, 1.0], score).astype(np.int64)
    return OrdinalData(
        x, np.ones((30, 1)), zeros[:1], category, participant, zeros, 3, 5, 1, np.ones((30, 1)), zeros[:1]
    )


AT = Parameters(np.array([-1.1, 0.9]), np.array([0.7]), np.array([np.exp(0.2), 0.0]))


def test_many_nodes_give_the_integral(small) -> None:
    """Each participant's integral by adaptive quadrature of another kind."""
    edges = np.array([-np.inf, *AT.thresholds, np.inf])

    def density(u: float, person: int) -> float:
        mine = small.participant == person
        eta = small.x[mine] @ AT.beta + np.exp(0.2) * u
        category = small.category[mine]
        chance = special.expit(edges[category + 1] - eta) - special.expit(edges[category] - eta)
        return float(np.prod(chance) * np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi))

    total = sum(np.log(integrate.quad(density, -9, 9, args=(p,), epsabs=0)[0]) for p in range(5))
    likelihood = QuadratureLikelihood(small, 40)
    assert likelihood.evaluate(AT)[0] == pytest.approx(total, abs=1e-9)


def test_one_node_is_laplace(small) -> None:
    likelihood = QuadratureLikelihood(small, 1)
    assert likelihood.evaluate(AT)[0] == pytest.approx(LaplaceLikelihood(small).evaluate(AT)[0], abs=1e-7)


def test_the_gradient_is_that_of_the_sum(small) -> None:
    likelihood = QuadratureLikelihood(small, 7)
    packed = np.concatenate([AT.thresholds, AT.beta, AT.sd[:1]])

    def value(values: np.ndarray) -> float:
        return likelihood.evaluate(Parameters(values[:2], values[2:3], np.append(values[3:], 0.0)))[0]

    _, gradient = likelihood.evaluate(AT)
    exact = np.concatenate([gradient.thresholds, gradient.beta, gradient.sd[:1]])
    steps = 1e-6 * np.eye(4)
    differences = [(value(packed + step) - value(packed - step)) / 2e-6 for step in steps]
    assert exact == pytest.approx(differences, rel=1e-6, abs=1e-7)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"item": "clip"}, "also has the item clip"),
        ({"slopes": "main"}, "also has slopes"),
        ({"quadrature": 101}, "1 to 100 nodes"),
    ],
)
def test_models_it_is_not_for_are_refused(more, said) -> None:
    rows = pd.read_csv(GOLDEN / "models" / "ordinal_small.csv")
    with pytest.raises(InputError, match=said):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], **({"quadrature": 10} | more))


def test_an_sd_at_its_limit_is_noted(monkeypatch) -> None:
    for module in ("ordinal_maximum", "ordinal"):
        monkeypatch.setattr(f"analysis.models.{module}.SD_MAX", np.exp(0.5))
    rows = pd.read_csv(GOLDEN / "models" / "ordinal_far_apart.csv")
    result = fit_ordinal(rows, "participant", "rating", ["A"])
    assert result.sd_participant == pytest.approx(np.exp(0.5))
    assert "the SD of participants is at its upper limit of 1.6" in result.notes[-1]


FEW = pd.read_csv(GOLDEN / "few_answers.csv")
OF_FEW = json.loads((GOLDEN / "few_answers.json").read_text(encoding="utf-8"))


def test_the_default_is_accurate_where_laplace_is_far_off() -> None:
    """glmer with 50 nodes; Laplace's SD is off by more than a twentieth."""
    theirs = OF_FEW["quadrature"]
    ours = fit_ordinal(FEW, "participant", "answer", [], between=["group"], covariates=["time"])
    assert [c.estimate for c in ours.coefficients] == pytest.approx(theirs["estimates"], rel=2e-3)
    assert [c.se for c in ours.coefficients] == pytest.approx(theirs["se"], rel=2e-3)
    assert ours.sd_participant == pytest.approx(theirs["sd"], rel=1e-3)
    assert ours.quadrature > 1
    laplace = fit_ordinal(
        FEW, "participant", "answer", [], between=["group"], covariates=["time"], quadrature=1
    )
    assert laplace.sd_participant == pytest.approx(OF_FEW["laplace"]["sd"], rel=1e-3)
    assert abs(laplace.sd_participant / ours.sd_participant - 1) > 0.05


def test_laplace_is_warned_of_where_it_is_not_accurate_and_only_there() -> None:
    far = fit_ordinal(FEW, "participant", "answer", [], slopes="all", covariates=["time"])
    assert any("Laplace's approximation is not accurate" in note for note in far.notes)
    rows = pd.read_csv(GOLDEN / "ordinal_slopes.csv")
    near = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", "main")
    assert not any("Laplace" in note for note in near.notes)


def test_the_warning_knows_how_far_the_estimates_are_off() -> None:
    """One step from Laplace's maximum goes most of the way to that of the integrals."""
    from analysis.models.ordinal_maximum import laplace_step, maximise, pooled_start

    rng = np.random.default_rng(8)
    participant = np.repeat(np.arange(80), 6)
    x = rng.choice([-1.0, 1.0], (480, 1))
    score = 0.8 * x[:, 0] + rng.normal(0, 1.5, 80)[participant] + rng.logistic(size=480)
    zeros = np.zeros(480, np.int64)
    data = OrdinalData(
        x,
        np.ones((480, 1)),
        zeros[:1],
        (score > 0).astype(np.int64),
        participant,
        zeros,
        2,
        80,
        1,
        np.ones((480, 1)),
        zeros[:1],
    )
    laplace = maximise(LaplaceLikelihood(data), pooled_start(data, False), False)
    exact = maximise(QuadratureLikelihood(data, 60), laplace.parameters, False).parameters
    step = laplace_step(data, laplace, False)
    off = exact.sd[0] - laplace.parameters.sd[0]
    assert abs(off) > 0.02 * exact.sd[0]
    assert step[-2] == pytest.approx(off, rel=0.35)
    assert step[1] == pytest.approx(exact.beta[0] - laplace.parameters.beta[0], rel=0.5)


def test_points_of_many_dimensions_find_nothing_where_laplace_is_nearly_exact() -> None:
    """Many ratings of each participant: a warning would be the points' own error."""
    from analysis.models.ordinal_maximum import laplace_step, maximise, pooled_start

    rng = np.random.default_rng(9)
    n, each = 12, 200
    participant = np.repeat(np.arange(n), each)
    z = np.column_stack([np.ones(n * each), rng.choice([-1.0, 1.0], (n * each, 3))])
    own = rng.normal(0, 1, (n, 4))
    score = 0.5 * z[:, 1] + (z * own[participant]).sum(axis=1) + rng.logistic(size=n * each)
    zeros = np.zeros(n * each, np.int64)
    category = np.searchsorted([-1.5, 0.0, 1.5], score).astype(np.int64)
    data = OrdinalData(
        z[:, 1:], z, np.arange(4), category, participant, zeros, 4, n, 1, np.ones((len(z), 1)), zeros[:1]
    )
    maximum = maximise(LaplaceLikelihood(data), pooled_start(data, False), False)
    step, errors = laplace_step(data, maximum, False), np.sqrt(np.diag(maximum.covariance))
    assert (np.abs(step[3:6]) < 0.03 * errors[3:6]).all()
    assert (np.abs(step[6:10]) < 0.03 * maximum.parameters.sd[:4]).all()
