"""Groups and covariates agree with R (afex, car, emmeans) to a relative 1e-8: tests/golden/r/between.R."""

import json
from pathlib import Path

import pandas as pd
import pytest

from analysis.read.long_csv import design_of
from analysis.within.anova import AnovaResult, linear_anova
from analysis.within.cell_means import cell_table
from analysis.within.estimates import margin_of, means_of
from analysis.within.pairwise import pairs_of
from analysis.within.simple_effects import simple_effect

GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "between"
CASES = sorted(path.stem for path in GOLDEN.glob("*.json"))


def near(ours: float, theirs: float | None, what: str) -> None:
    assert theirs is None or ours == pytest.approx(theirs, rel=1e-8, abs=1e-12), what


def relative(ours: float, theirs: float | None, what: str) -> None:
    """No absolute floor: p, epsilon and sizes agree in their own digits."""
    assert theirs is None or ours == pytest.approx(theirs, rel=1e-8, abs=0), what


def levels_of(result: AnovaResult) -> dict[str, tuple[str, ...]]:
    return dict(zip(result.all_factors, result.all_levels, strict=True))


@pytest.fixture(scope="module", params=CASES)
def case(request) -> tuple[dict, AnovaResult]:
    expected = json.loads((GOLDEN / f"{request.param}.json").read_text(encoding="utf-8"))
    within, between = expected.get("within") or [], expected.get("between") or []
    covariates = expected.get("covariates") or []
    rows = pd.read_csv(GOLDEN / expected["file"], dtype=dict.fromkeys(["id", *within, *between], str))
    cells = cell_table(rows, "id", "y", within)
    design = design_of(rows, "id", cells.participants, between, covariates)
    return expected, linear_anova(cells.y, within, cells.levels, design, expected["type"])


def test_every_effect(case) -> None:
    expected, result = case
    assert {frozenset(e.factors) for e in result.effects} == {
        frozenset(e["effect"].split(":")) for e in expected["effects"]
    }
    for theirs in expected["effects"]:
        ours = result.effect(theirs["effect"])
        for key, value in theirs["univariate"].items():
            relative(getattr(ours.univariate, key), value, f"{ours.effect} {key}")
        relative(ours.eta_sq_partial, theirs["eta_sq_partial"], ours.effect)
        relative(ours.eta_sq_generalized, theirs["eta_sq_generalized"], ours.effect)
        if theirs.get("mauchly_w") is not None and ours.mauchly is not None:
            relative(ours.mauchly.w, theirs["mauchly_w"], f"{ours.effect} W")


def test_four_multivariate_statistics(case) -> None:
    expected, result = case
    for theirs in expected["effects"]:
        if "multivariate" not in theirs:
            continue
        ours = result.effect(theirs["effect"]).multivariate
        assert (ours is None) == (theirs["multivariate"] is None), theirs["effect"]
        for name, statistic in (theirs["multivariate"] or {}).items():
            for key, value in statistic.items():
                mine = getattr(getattr(ours.statistics, name), key)
                relative(mine, value, f"{theirs['effect']} {name} {key}")


def test_marginal_means(case) -> None:
    expected, result = case
    for margin in expected["marginal_means"]:
        ours = {frozenset(m.levels.items()): m for m in means_of(margin_of(result, margin["factors"]))}
        assert len(ours) == len(margin["means"])
        for theirs in margin["means"]:
            mean = ours[frozenset(theirs["levels"].items())]
            near(mean.mean, theirs["mean"], mean.effect)
            near(mean.se, theirs["se"], mean.effect)
            assert result.df_error == theirs["df"]


def test_pairs(case) -> None:
    expected, result = case
    for margin in expected["pairwise"]:
        order = [name for name in result.all_factors if name in margin["factors"]]
        turned = [margin["factors"].index(name) for name in order]
        ours = {(p.level_a, p.level_b): p for p in pairs_of(result, order)}
        for theirs in margin["pairs"]:
            a, b = (":".join(theirs[key].split(":")[i] for i in turned) for key in ("level_a", "level_b"))
            sign = 1 if (a, b) in ours else -1
            pair = ours[(a, b) if sign == 1 else (b, a)]
            near(sign * pair.difference, theirs["difference"], f"{margin['factors']} {a} {b}")
            for key in ("se", "df", "p", "p_sidak", "p_fdr"):
                relative(getattr(pair, key), theirs[key], f"{margin['factors']} {a} {b} {key}")
            # R's ptukey is off by up to 2.1e-7 here; scipy's studentized_range agrees with ours
            assert pair.p_tukey == pytest.approx(theirs["p_tukey"], rel=1e-6, abs=3e-7)


def test_simple_effects(case) -> None:
    expected, result = case
    for theirs in expected.get("simple") or []:
        other = next(name for name in result.all_factors if theirs["at"] in levels_of(result)[name])
        ours = simple_effect(result, theirs["of"], {other: theirs["at"]})
        q, nu = theirs["df_effect"], theirs["df_error"]
        if ours.multivariate is None:
            continue
        # emmeans prints T^2 / q on (q, nu); Hotelling's exact F is that times (nu - q + 1) / nu
        # (printed with three decimals)
        emmeans = ours.multivariate.f_value * nu / (nu - q + 1)
        assert emmeans == pytest.approx(theirs["f_value"], abs=5.1e-4), theirs
        assert (ours.multivariate.df_effect, ours.multivariate.df_error) == (q, nu - q + 1)
