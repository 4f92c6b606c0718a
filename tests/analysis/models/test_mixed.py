"""The linear mixed model against lmerTest (golden), against brute force, and on bad input."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.models.columns import ModelTerms
from analysis.models.design import model_data
from analysis.models.mixed import fit_mixed
from analysis.models.reml import Term, criterion, cross_products, intercept_term
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "models"
FITS = [
    (path.stem, index, fit["slopes"])
    for path in sorted(GOLDEN.glob("mixed_*.json"))
    for index, fit in enumerate(json.loads(path.read_text(encoding="utf-8"))["fits"])
    if fit["model"] == "mixed"
]


@pytest.mark.parametrize(("name", "index", "slopes"), FITS)
def test_agrees_with_lmertest(name, index, slopes):
    expected = json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
    fit = expected["fits"][index]
    ours = fit_mixed(
        pd.read_csv(GOLDEN / f"{name}.csv"), "participant", "rating", expected["factors"], "clip", slopes
    )
    assert ours.reml_criterion == pytest.approx(fit["reml_criterion"], abs=1e-6)
    assert ours.sigma == pytest.approx(fit["sigma"], rel=1e-4)
    # R writes B:C:A as it likes: compare effects by their factors
    theirs = {frozenset(e["effect"].split(":")): e for e in fit["effects"]}
    for effect in ours.effects:
        wanted = theirs[frozenset(effect.effect.split(":"))]
        assert effect.df_effect == wanted["df_effect"]
        assert effect.f_value == pytest.approx(wanted["f_value"], rel=1e-4), effect.effect
        assert effect.df_error == pytest.approx(wanted["df_error"], rel=1e-4), effect.effect
        assert effect.p_value == pytest.approx(wanted["p_value"], rel=1e-3), effect.effect


def small_data(seed: int, people: int = 6, clips: int = 4) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    rows = [
        (f"p{p}", f"{a}{c}", f"a{a}", f"b{b}", rng.normal() + 0.5 * a + 0.3 * p * (b - 0.5))
        for p in range(people)
        for a in range(2)
        for b in range(3)
        for c in range(clips)
    ]
    return pd.DataFrame(rows, columns=["who", "clip", "A", "B", "y"])


def dense_criterion(x, z_person, z_item, y, lp, lam, people) -> float:
    n, f = x.shape
    v = np.eye(n) + lam**2 * z_item @ z_item.T
    for person in range(people.max() + 1):
        z = np.where((people == person)[:, None], z_person, 0.0) @ lp
        v += z @ z.T
    inverse = np.linalg.inv(v)
    a = x.T @ inverse @ x
    residual = y - x @ np.linalg.solve(a, x.T @ inverse @ y)
    r2 = residual @ inverse @ residual
    h = np.linalg.slogdet(v)[1] + np.linalg.slogdet(a)[1]
    return h + (n - f) * (1 + np.log(2 * np.pi * r2 / (n - f)))


@given(st.integers(0, 1000), st.lists(st.floats(0.0, 2.0), min_size=4, max_size=4))
@settings(max_examples=15, deadline=None)
def test_criterion_and_gradient_by_brute_force(seed, theta):
    data = model_data(small_data(seed), ModelTerms("who", "y", ("A", "B"), ("clip",)))
    x, z = data.x, data.spread[:, :2][data.cell]
    people, clips = data.groups
    patterns = np.array([[[1, 0], [0, 0]], [[0, 0], [1, 0]], [[0, 0], [0, 1]]], dtype=float)
    c = cross_products(x, data.rating, [Term(people.codes, 6, z, patterns), intercept_term(clips.codes, 8)])
    theta = np.array(theta)
    at = criterion(c, theta)
    lp = np.tensordot(theta[:3], patterns, 1)
    items = np.eye(8)[clips.codes]
    slow = dense_criterion(x, z, items, data.rating, lp, theta[3], people.codes)
    assert at.value == pytest.approx(slow, rel=1e-10)
    for k in range(4):
        step = np.eye(4)[k] * 1e-5
        numeric = (criterion(c, theta + step).value - criterion(c, theta - step).value) / 2e-5
        assert at.gradient[k] == pytest.approx(numeric, rel=1e-4, abs=1e-4)


def test_balanced_data_give_the_anova_f_for_effects_without_items():
    """B is crossed with clips and participants: with slopes its F is that of the ANOVA."""
    from analysis.within.anova import within_anova
    from analysis.within.cell_means import cell_table

    rng = np.random.default_rng(5)
    rows = small_data(1, people=12)
    rows["y"] += rows["who"].map({w: rng.normal() for w in rows["who"].unique()})
    slope = rows.groupby(["who", "B"])["y"].transform(lambda g: 0.8 * rng.normal())
    rows["y"] += slope
    mixed = fit_mixed(rows, "who", "y", ["A", "B"], "clip", "all")
    table = cell_table(rows, "who", "y", ["A", "B"])
    f_value = within_anova(table.y, table.factors, table.levels).effect("B").univariate.f_value
    found = next(e for e in mixed.effects if e.effect == "B")
    assert found.f_value == pytest.approx(f_value, rel=1e-3)


@given(st.floats(-50, 50), st.floats(0.1, 20))
@settings(max_examples=5, deadline=None)
def test_shift_and_scale_change_no_test(shift, scale):
    rows = small_data(3)
    moved = rows.assign(y=shift + scale * rows["y"])
    first = fit_mixed(rows, "who", "y", ["A", "B"], "clip", "main")
    second = fit_mixed(moved, "who", "y", ["A", "B"], "clip", "main")
    for a, b in zip(first.effects, second.effects, strict=True):
        assert b.f_value == pytest.approx(a.f_value, rel=1e-4)
        assert b.df_error == pytest.approx(a.df_error, rel=1e-3)


def test_one_rating_a_cell_drops_the_slope_of_the_highest_interaction():
    rows = small_data(2, clips=1)
    result = fit_mixed(rows, "who", "y", ["A", "B"])
    assert "A:B" in result.notes[0]
    assert all(c.term != "A:B" for c in result.components)


def test_items_named_by_two_columns_are_distinguished():
    rows = small_data(2).assign(exemplar=lambda d: d["clip"].str[1:])
    joined = fit_mixed(rows, "who", "y", ["A", "B"], ["A", "exemplar"], "main")
    single = fit_mixed(rows, "who", "y", ["A", "B"], "clip", "main")
    assert joined.n_items == single.n_items == 8
    assert joined.reml_criterion == pytest.approx(single.reml_criterion, abs=1e-8)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"y": 4.0}, "every rating is 4"),
        ({"y": "good"}, "expected numbers"),
        ({"who": "one"}, "at least two participants"),
        ({"A": "a0"}, "at least two levels of 'A'"),
        ({"clip": "x"}, "at least two items"),
    ],
)
def test_bad_input_is_one_clear_line(change, said):
    with pytest.raises(InputError, match=said):
        fit_mixed(small_data(0).assign(**change), "who", "y", ["A", "B"], "clip")


def test_unknown_column_and_empty_cell():
    rows = small_data(0)
    with pytest.raises(InputError, match="did you mean 'clip'"):
        fit_mixed(rows, "who", "y", ["A"], "clipp")
    holed = rows[~((rows["A"] == "a0") & (rows["B"] == "b1"))]
    with pytest.raises(InputError, match="nobody rated the cell A=a0, B=b1"):
        fit_mixed(holed, "who", "y", ["A", "B"], "clip")
