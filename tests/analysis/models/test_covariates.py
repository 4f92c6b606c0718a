"""Covariates that vary within participants have slopes, and interact: lmerTest's values."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
EXPECTED = json.loads((GOLDEN / "covariates.json").read_text(encoding="utf-8"))
ROWS = pd.read_csv(GOLDEN / "covariates.csv")
CASES = Path(__file__).parents[4] / "shared/cases/statistics"
PRODUCTS = ["dose", "age", "group:dose", "cond:dose", "age:dose"]


@pytest.mark.parametrize(
    ("model", "arguments"),
    [
        ("plain", {"within": [], "covariates": ["dose"]}),
        ("main", {"within": ["cond"], "between": ["group"], "covariates": ["dose"]}),
        ("products", {"within": ["cond"], "between": ["group"], "covariates": PRODUCTS}),
        ("none", {"within": [], "covariates": ["dose"], "slopes": "none"}),
    ],
)
@pytest.mark.parametrize(("df", "key"), [("satterthwaite", "effects"), ("kenward-roger", "kr")])
def test_a_covariate_within_participants_has_a_slope_as_in_lmertest(model, arguments, df, key) -> None:
    ours = fit_mixed(ROWS, "participant", "rating", df_method=df, **arguments)
    theirs = EXPECTED[model]
    assert ours.reml_criterion == pytest.approx(theirs["reml"], abs=1e-4)
    found = {frozenset(e.effect.split(":")): e for e in ours.effects}
    for wanted in theirs[key]:
        effect = found.pop(frozenset(wanted["effect"].split(":")))
        assert effect.f_value == pytest.approx(wanted["f_value"], rel=2e-3), effect
        assert effect.df_effect == wanted["df_effect"]
        assert effect.df_error == pytest.approx(wanted["df_error"], rel=2e-3), effect
    assert not found


def test_the_slope_of_a_covariate_is_in_its_own_unit_and_correlates_with_the_intercept() -> None:
    fit = fit_mixed(ROWS, "participant", "rating", [], covariates=["dose"])
    sds = {(row["var1"], row.get("var2")): row["sdcor"] for row in EXPECTED["plain"]["sds"] if "var1" in row}
    intercept, slope, _ = fit.components
    assert intercept.sd == pytest.approx(sds["(Intercept)", None], rel=1e-3)
    assert slope.sd == pytest.approx(sds["dose", None], rel=1e-3)
    assert slope.correlations[0] == pytest.approx(sds["(Intercept)", "dose"], rel=1e-3)
    assert "(1 + dose | participant)" in fit.formula


@pytest.mark.parametrize("slopes", ["all", "main", "correlated"])
def test_units_and_origin_of_a_covariate_change_no_test(slopes) -> None:
    moved = ROWS.assign(dose=ROWS["dose"] * 1e-4 + 7)
    first = fit_mixed(ROWS, "participant", "rating", ["cond"], slopes=slopes, covariates=["dose"])
    second = fit_mixed(moved, "participant", "rating", ["cond"], slopes=slopes, covariates=["dose"])
    for a, b in zip(first.effects, second.effects, strict=True):
        assert (a.f_value, a.df_error) == pytest.approx((b.f_value, b.df_error), rel=1e-4)


def test_a_model_without_slopes_names_the_covariates_that_lack_one() -> None:
    ordered = ROWS.assign(rating=ROWS["rating"].round().clip(3, 8))
    for fit in (
        fit_mixed(ROWS, "participant", "rating", [], slopes="none", covariates=["dose", "age"]),
        fit_ordinal(ordered, "participant", "rating", [], slopes="none", covariates=["dose", "age"]),
    ):
        assert any("dose varies within participants and has no by-participant slope" in n for n in fit.notes)


def test_an_ordinal_model_has_slopes_of_covariates_as_glmer() -> None:
    theirs = EXPECTED["ordinal"]
    rows = ROWS.assign(high=(ROWS["rating"] > 6.5).astype(int))
    fit = fit_ordinal(rows, "participant", "high", [], slopes="all", covariates=["dose"], quadrature=1)
    assert fit.log_likelihood == pytest.approx(theirs["logLik"], abs=1e-4)
    dose = next(c for c in fit.coefficients if c.name == "dose")
    assert (dose.estimate, dose.se) == pytest.approx((theirs["estimate"], theirs["se"]), rel=5e-3)
    sds = [row["sdcor"] for row in theirs["sds"]]
    assert [c.sd for c in fit.components] == pytest.approx([sds[0], sds[1] / 10], rel=5e-3)


def test_two_ratings_of_each_participant_leave_no_room_for_a_slope() -> None:
    rng = np.random.default_rng(4)
    rows = pd.DataFrame({"who": np.repeat(np.arange(12), 2), "time": np.tile([0, 1], 12)})
    rows["y"] = rng.normal(size=24) + rows["time"] + np.repeat(rng.normal(0, 3, 12), 2)
    fit = fit_mixed(rows, "who", "y", [], covariates=["time"])
    differences = rows["y"].to_numpy().reshape(-1, 2) @ [-1, 1]
    t = differences.mean() / (differences.std(ddof=1) / 12**0.5)
    assert fit.effects[0].f_value == pytest.approx(t**2, rel=1e-5)
    assert fit.effects[0].df_error == pytest.approx(11, rel=1e-3)
    assert any("no slope of time" in note for note in fit.notes)


def test_bad_interactions_are_one_clear_line() -> None:
    for named, said in ((["cond:group"], "names only factors"), (["dose:dose"], "different columns")):
        with pytest.raises(InputError, match=said):
            fit_mixed(ROWS, "participant", "rating", ["cond"], between=["group"], covariates=named)


@pytest.mark.skipif(not CASES.exists(), reason="../shared/cases is not here")
def test_sleepstudy_gives_what_lmer_gives() -> None:
    rows = pd.read_csv(CASES / "c30_sleepstudy.csv")
    days = fit_mixed(rows, "Subject", "Reaction", [], covariates=["Days"]).effects[0]
    assert (days.f_value, days.df_error) == pytest.approx((45.853, 17), abs=1e-3)
