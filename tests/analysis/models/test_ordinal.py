"""The cumulative-link mixed model against ordinal::clmm (golden), quadrature, and on bad input."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.models.laplace import LaplaceLikelihood, OrdinalData, Parameters
from analysis.models.ordinal import fit_ordinal
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "models"
FITS = [
    (path.stem, index)
    for path in sorted(GOLDEN.glob("*.json"))
    for index, fit in enumerate(json.loads(path.read_text(encoding="utf-8"))["fits"])
    if fit["model"] == "ordinal"
]


@pytest.mark.parametrize(("name", "index"), FITS)
def test_agrees_with_clmm(name, index):
    expected = json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
    fit = expected["fits"][index]
    rows = pd.read_csv(GOLDEN / f"{name}.csv")
    ours = fit_ordinal(rows, "participant", "rating", expected["factors"], "clip")
    assert ours.log_likelihood >= fit["log_likelihood"] - 1e-3
    assert ours.log_likelihood == pytest.approx(fit["log_likelihood"], abs=0.01)
    # clmm stops early on mixed_exp1 (0.0016 below our maximum): its estimates are good to two digits only
    assert ours.sd_participant == pytest.approx(fit["standard_deviations"]["participant"], rel=2e-3)
    assert ours.sd_item == pytest.approx(fit["standard_deviations"]["clip"], rel=2e-3)
    assert np.allclose(ours.thresholds, fit["thresholds"], atol=0.02)
    theirs = {_key(n): (b, fit["standard_errors"][n]) for n, b in fit["coefficients"].items()}
    for coefficient in ours.coefficients:
        b, se = theirs[_key(coefficient.name.replace("[", "").replace("]", ""), expected)]
        assert coefficient.estimate == pytest.approx(b, abs=1e-3)
        assert coefficient.se == pytest.approx(se, rel=5e-3)


def _key(name: str, expected: dict | None = None) -> frozenset[str]:
    """R calls A's first sum-coded column A1, ours is A[a1]."""
    parts = name.split(":")
    if expected is not None:
        parts = [part[0] + part[2:] for part in parts]
    return frozenset(parts)


def problem(seed: int) -> tuple[OrdinalData, Parameters]:
    rng = np.random.default_rng(seed)
    people, items = 5, 4
    who, what = (a.ravel() for a in np.meshgrid(np.arange(people), np.arange(items), indexing="ij"))
    x = rng.normal(size=(len(who), 2))
    data = OrdinalData(x, rng.integers(0, 4, len(who)), who, what, 4, people, items)
    gaps = np.cumsum(rng.uniform(0.3, 1.5, 3)) - 1.5
    return data, Parameters(gaps, rng.normal(size=2), rng.uniform(-1.5, 0.7, 2))


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_is_that_of_the_likelihood(seed):
    data, p = problem(seed)
    likelihood = LaplaceLikelihood(data)
    _, gradient = likelihood.evaluate(p)
    for name in ("thresholds", "beta", "log_sd"):
        at = getattr(p, name)
        for k in range(len(at)):
            sides = []
            for step in (1e-5, -1e-5):
                moved = at.copy()
                moved[k] += step
                sides.append(likelihood.evaluate(Parameters(**{**vars(p), name: moved}))[0])
            numeric = (sides[0] - sides[1]) / 2e-5
            assert getattr(gradient, name)[k] == pytest.approx(numeric, rel=1e-4, abs=2e-5)


def test_without_spread_it_is_the_plain_ordinal_likelihood():
    data, p = problem(3)
    none = Parameters(p.thresholds, p.beta, np.array([-20.0, -20.0]))
    value, _ = LaplaceLikelihood(data).evaluate(none)
    edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
    eta = data.x @ p.beta
    share = 1 / (1 + np.exp(-(edges[data.category + 1] - eta)))
    share = share - 1 / (1 + np.exp(-(edges[data.category] - eta)))
    assert value == pytest.approx(np.log(share).sum(), rel=1e-9)


def test_swapping_participants_and_items_changes_nothing():
    data, p = problem(8)
    turned = OrdinalData(data.x, data.category, data.item, data.participant, 4, 4, 5)
    value, _ = LaplaceLikelihood(data).evaluate(p)
    other, _ = LaplaceLikelihood(turned).evaluate(Parameters(p.thresholds, p.beta, p.log_sd[::-1]))
    assert other == pytest.approx(value, rel=1e-12)


def test_continuous_ratings_are_refused():
    rows = pd.read_csv(GOLDEN / "mixed_two_by_two.csv")
    with pytest.raises(InputError, match="at most 20 distinct ratings"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip")
