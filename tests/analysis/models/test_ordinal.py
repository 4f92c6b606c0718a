"""The cumulative-link mixed model against ordinal::clmm (golden), quadrature, and on bad input."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.special import expit

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
    assert ours.log_likelihood >= fit["log_likelihood"] - 4e-8
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


def problem(seed: int, columns: int = 1, items: int = 4, of_items: int = 1) -> tuple[OrdinalData, Parameters]:
    """Five people, some items; the columns of each after the first share one SD."""
    rng = np.random.default_rng(seed)
    people = 5
    who, what = (a.ravel() for a in np.meshgrid(np.arange(people), np.arange(items), indexing="ij"))
    x = rng.normal(size=(len(who), 2))
    z = np.hstack([np.ones((len(who), 1)), rng.normal(size=(len(who), columns - 1))])
    term = np.minimum(np.arange(columns), 1)
    category = rng.integers(0, 4, len(who))
    z_item = np.hstack([np.ones((len(who), 1)), rng.normal(size=(len(who), of_items - 1))])
    term_item = np.minimum(np.arange(of_items), 1)
    data = OrdinalData(x, z, term, category, who, what, 4, people, items, z_item, term_item)
    gaps = np.cumsum(rng.uniform(0.3, 1.5, 3)) - 1.5
    return data, Parameters(gaps, rng.normal(size=2), np.exp(rng.uniform(-1.5, 0.7, data.n_sds)))


@given(st.integers(0, 10_000), st.sampled_from([(1, 4), (1, 7), (3, 4), (3, 20), (3, 4, 2), (2, 7, 3)]))
@settings(max_examples=25, deadline=None)
def test_gradient_is_that_of_the_likelihood(seed, shape):
    data, p = problem(seed, *shape)
    likelihood = LaplaceLikelihood(data)
    _, gradient = likelihood.evaluate(p)
    for name in ("thresholds", "beta", "sd"):
        at = getattr(p, name)
        for k in range(len(at)):
            sides = []
            for step in (1e-5, -1e-5):
                moved = at.copy()
                moved[k] += step
                sides.append(likelihood.evaluate(Parameters(**{**vars(p), name: moved}))[0])
            numeric = (sides[0] - sides[1]) / 2e-5
            assert getattr(gradient, name)[k] == pytest.approx(numeric, rel=1e-4, abs=5e-5)


@pytest.mark.parametrize("shape", [(3, 4), (3, 20), (2, 4, 3)])
def test_the_value_is_that_of_the_dense_approximation(shape):
    """By the definition: the joint density at its mode, by a general optimiser, log|H| from differences."""
    data, p = problem(11, *shape)
    value, _ = LaplaceLikelihood(data).evaluate(p)
    size = data.n_participants * data.z.shape[1]

    def joint(effects):
        u, v = effects[:size].reshape(data.n_participants, -1), effects[size:].reshape(data.n_items, -1)
        people, items = p.sd[: data.n_terms][data.term], p.sd[data.n_terms :][data.term_item]
        eta = data.x @ p.beta + (data.z * people * u[data.participant]).sum(axis=1)
        eta = eta + (data.z_item * items * v[data.item]).sum(axis=1)
        edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
        shares = expit(edges[data.category + 1] - eta) - expit(edges[data.category] - eta)
        return effects @ effects / 2 - np.log(shares).sum()

    mode = minimize(
        joint, np.zeros(size + data.n_items * data.z_item.shape[1]), method="BFGS", options={"gtol": 1e-7}
    ).x
    step = 1e-4 * np.eye(len(mode))
    sides = np.array(
        [[joint(mode + s * a + t * b) * s * t for s in (1, -1) for t in (1, -1)] for a in step for b in step]
    )
    hessian = sides.sum(axis=1).reshape(len(mode), -1) / 4e-8
    dense = -joint(mode) - np.linalg.slogdet(hessian)[1] / 2
    assert value == pytest.approx(dense, rel=1e-5)


def test_slopes_equal_those_of_clmm():
    expected = json.loads((GOLDEN.parent / "ordinal_slopes.json").read_text())
    rows = pd.read_csv(GOLDEN.parent / "ordinal_slopes.csv")
    ours = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", slopes="main")
    assert ours.log_likelihood == pytest.approx(expected["log_likelihood"], abs=1e-5)
    assert ours.thresholds == pytest.approx(expected["thresholds"], abs=2e-3)
    sds = {component.term: component.sd for component in ours.components[:-1]}
    spread = {name.split()[-1]: sd for name, sd in expected["sds"].items() if name.startswith("participant")}
    theirs = {"intercept": spread["(Intercept)"], "A": spread["xA"], "B": spread["xB"]}
    assert sds == pytest.approx(theirs, rel=2e-3)
    assert ours.sd_item == pytest.approx(expected["sds"]["clip (Intercept)"], rel=2e-3)
    assert [c.estimate for c in ours.coefficients] == pytest.approx(
        [expected["coefficients"][name] for name in ("A1", "B1", "A1:B1")], abs=1e-3
    )
    assert [c.se for c in ours.coefficients] == pytest.approx(
        [expected["se"][name] for name in ("A1", "B1", "A1:B1")], rel=5e-3
    )
    # a test of A without its slope takes the spread of people for none
    without = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip")
    assert without.effects[0].p_value < ours.effects[0].p_value / 5


def test_slopes_of_items_equal_those_of_clmm():
    expected = json.loads((GOLDEN.parent / "item_slopes.json").read_text())
    rows = pd.read_csv(GOLDEN.parent / "item_slopes.csv")
    ours = fit_ordinal(rows, "participant", "rating", ["a"], "clip", slopes="all", item_slopes=["a"])
    assert ours.log_likelihood == pytest.approx(expected["log_likelihood"], abs=1e-5)
    assert ours.thresholds == pytest.approx(expected["thresholds"], abs=1e-3)
    (a,) = ours.coefficients
    assert (a.estimate, a.se) == pytest.approx((expected["estimate"], expected["se"]), rel=2e-3)
    theirs = {"intercept": "(Intercept)", "a": "x"}
    sds = {f"{component.group} {theirs[component.term]}": component.sd for component in ours.components}
    assert sds == pytest.approx(expected["sds"], rel=2e-3)
    assert ours.notes == ()
    # A test of a without the clips' slope takes their spread for none.
    without = fit_ordinal(rows, "participant", "rating", ["a"], "clip", slopes="all")
    assert without.coefficients[0].se < 0.7 * a.se


def test_a_slope_that_no_item_determines_is_refused():
    rows = pd.read_csv(GOLDEN.parent / "ordinal_slopes.csv")
    with pytest.raises(InputError, match="the slope of A by clip is not determined"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", item_slopes=["A"])


def test_separated_cells_are_called_so_and_not_too_few_ratings():
    cells = ["ct", "cm", "pt", "ct", "pm", "pm", "cm", "pt"]
    rows = pd.DataFrame(
        [
            (person, a, b, f"clip{number}", int(rating))
            for person, ratings in (("P", "44233343"), ("Q", "35244444"))
            for number, ((a, b), rating) in enumerate(zip(cells, ratings, strict=True))
        ],
        columns=["participant", "A", "B", "clip", "rating"],
    )
    with pytest.raises(InputError, match=r"ratings are separated: .* A\[c\]"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", slopes="main")


def test_correlated_slopes_are_refused():
    rows = pd.read_csv(GOLDEN.parent / "ordinal_slopes.csv")
    with pytest.raises(InputError, match="expected all, main or none"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", slopes="correlated")


def test_without_spread_it_is_the_plain_ordinal_likelihood():
    data, p = problem(3)
    none = Parameters(p.thresholds, p.beta, np.zeros(2))
    value, _ = LaplaceLikelihood(data).evaluate(none)
    edges = np.concatenate([[-np.inf], p.thresholds, [np.inf]])
    eta = data.x @ p.beta
    share = 1 / (1 + np.exp(-(edges[data.category + 1] - eta)))
    share = share - 1 / (1 + np.exp(-(edges[data.category] - eta)))
    assert value == pytest.approx(np.log(share).sum(), rel=1e-9)


def test_swapping_participants_and_items_changes_nothing():
    data, p = problem(8, 3, 4, 2)
    turned = replace(
        data,
        z=data.z_item,
        term=data.term_item,
        participant=data.item,
        n_participants=data.n_items,
        z_item=data.z,
        term_item=data.term,
        item=data.participant,
        n_items=data.n_participants,
    )
    value, gradient = LaplaceLikelihood(data).evaluate(p)
    sds = np.roll(p.sd, data.n_sds - data.n_terms)
    other, turned_gradient = LaplaceLikelihood(turned).evaluate(Parameters(p.thresholds, p.beta, sds))
    assert other == pytest.approx(value, rel=1e-12)
    assert np.roll(turned_gradient.sd, data.n_terms) == pytest.approx(gradient.sd, rel=1e-8)


def test_continuous_ratings_are_refused():
    rows = pd.read_csv(GOLDEN / "mixed_two_by_two.csv")
    with pytest.raises(InputError, match="at most 20 distinct ratings"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip")


@pytest.mark.parametrize("shared", [0, 1])
def test_separated_ratings_are_refused(shared):
    """Also where the two levels share one category: its thresholds can then move apart without end."""
    rng = np.random.default_rng(2)
    rows = pd.DataFrame(
        [
            (f"p{p}", level, rng.integers(1, 3) if level == "m" else rng.integers(3 - shared, 6))
            for p in range(8)
            for level in "mn"
            for _ in range(6)
        ],
        columns=["who", "level", "y"],
    )
    with pytest.raises(InputError, match="no rating at level=m is above any other"):
        fit_ordinal(rows, "who", "y", ["level"])
    overlapping = pd.concat([rows, pd.DataFrame([("p0", "m", 5)], columns=rows.columns)])
    assert np.isfinite(fit_ordinal(overlapping, "who", "y", ["level"]).log_likelihood)


def drawn(seed: int, sd_item: float = 0.0) -> pd.DataFrame:
    """Ten people, two crossed factors, three clips per cell, four categories of which the last is rare."""
    rng = np.random.default_rng(seed)
    rows = pd.DataFrame(
        [(f"p{p}", a, b, f"{a}{b}{k}") for p in range(10) for a in "mn" for b in "xy" for k in range(3)],
        columns=["participant", "A", "B", "clip"],
    )
    person = rng.normal(0, 0.8, 10)[pd.factorize(rows["participant"])[0]]
    item = rng.normal(0, sd_item, 12)[pd.factorize(rows["clip"])[0]]
    score = person + item + 0.5 * (rows["A"] == "m") + rng.logistic(size=len(rows))
    return rows.assign(rating=1 + np.searchsorted(np.quantile(score, [0.2, 0.6, 0.97]), score))


def test_an_sd_estimated_as_zero_costs_no_likelihood():
    """It was held at 1e-4, which lay up to 1e-6 below the model without the term."""
    seen = 0
    for seed in range(12):
        rows = drawn(seed)
        ours = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip")
        without = fit_ordinal(rows, "participant", "rating", ["A", "B"], quadrature=1)
        assert ours.log_likelihood >= without.log_likelihood - 1e-10
        if ours.sd_item == 0:
            seen += 1
            assert ours.log_likelihood == pytest.approx(without.log_likelihood, abs=1e-10)
            assert ours.singular
            assert "the SD of items is estimated as zero" in ours.notes
            assert ours.effects[0].chi2 == pytest.approx(without.effects[0].chi2, rel=1e-5)
    assert seen >= 3


@pytest.mark.parametrize("slopes", ["none", "all"])
def test_no_other_start_reaches_a_higher_likelihood(slopes, monkeypatch):
    """SDs of zero among them: the likelihood is level there, and a search that begins there must leave."""
    for seed in range(6):
        rows = drawn(seed, sd_item=0.7)
        ours = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", slopes=slopes)
        assert not [note for note in ours.notes if "stopped" in note]
        for sd in (0.0, 0.02, 3.0):
            monkeypatch.setattr("analysis.models.ordinal_maximum.START_SD", sd)
            other = fit_ordinal(rows, "participant", "rating", ["A", "B"], "clip", slopes=slopes)
            assert other.log_likelihood == pytest.approx(ours.log_likelihood, abs=1e-9)
            assert other.sd_item == pytest.approx(ours.sd_item, abs=1e-4)
        monkeypatch.undo()


def test_a_separated_cell_is_refused():
    """Every rating of one cell is the highest: no factor separates, yet its coefficients grow without end."""
    rows = drawn(1)
    rows.loc[(rows["A"] == "m") & (rows["B"] == "x"), "rating"] = 4
    rows.loc[rows.index[-1], "rating"] = 4
    with pytest.raises(InputError, match=r"the likelihood rises without limit as A.* grow"):
        fit_ordinal(rows, "participant", "rating", ["A", "B"])
    rows.loc[rows.index[0], "rating"] = 3
    assert max(c.se for c in fit_ordinal(rows, "participant", "rating", ["A", "B"]).coefficients) < 2
