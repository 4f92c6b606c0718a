"""Agreement with R (afex, car, emmeans) to a relative 1e-8; golden files: tests/golden/r/README.md."""

import json
import math
from pathlib import Path

import pandas as pd
import pytest
from scipy import stats

from analysis.within.anova import AnovaResult, Effect, within_anova
from analysis.within.cell_means import cell_table
from analysis.within.estimates import marginal_means
from analysis.within.pairwise import pairs_of

GOLDEN = Path(__file__).parents[2] / "golden" / "r" / "within"
CASES = sorted(path.stem for path in GOLDEN.glob("*.json"))


def near(ours: float, theirs: float | None, what: str) -> None:
    # 1e-12: what is exactly zero here is rounding noise there
    assert theirs is None or ours == pytest.approx(theirs, rel=1e-8, abs=1e-12), what


@pytest.fixture(params=CASES)
def case(request) -> tuple[dict, AnovaResult]:
    expected = json.loads((GOLDEN / f"{request.param}.json").read_text(encoding="utf-8"))
    rows = pd.read_csv(GOLDEN / f"{request.param}.csv", dtype=dict.fromkeys(["participant", *"ABCD"], str))
    table = cell_table(rows, "participant", "rating", expected["factors"])
    return expected, within_anova(table.y, table.factors, table.levels)


def mauchly_p_as_r_has_it(effect: Effect, result: AnovaResult) -> float:
    """R's mauchly.test: the textbook's second-order term with 3k for 3q, k the number of cells."""
    q, nu, k = effect.univariate.df_effect, result.n_participants - 1, result.y[0].size
    rho = 1 - (2 * q**2 + q + 2) / (6 * q * nu)
    chi2, df = -nu * rho * math.log(effect.mauchly.w), q * (q + 1) / 2 - 1
    omega = (q + 2) * (q - 1) * (q - 2) * (2 * q**3 + 6 * q**2 + 3 * k + 2) / (288 * (nu * q * rho) ** 2)
    upper, upper_4 = stats.chi2.sf(chi2, df), stats.chi2.sf(chi2, df + 4)
    return upper + omega * (upper_4 - upper)


def matched(case) -> list[tuple[Effect, dict]]:
    expected, result = case
    return [(result.effect(theirs["effect"]), theirs) for theirs in expected["effects"]]


def test_there_are_golden_files_of_every_kind() -> None:
    kinds = {name.rsplit("_", 1)[0] for name in CASES}
    assert {"complete", "unbalanced", "few_participants", "integer"} <= kinds


def test_univariate_and_corrections(case) -> None:
    expected, result = case
    assert {e.effect for e in result.effects} == {e["effect"] for e in expected["effects"]}
    for ours, theirs in matched(case):
        for key, value in theirs["univariate"].items():
            if hasattr(ours.univariate, key):
                near(getattr(ours.univariate, key), value, f"{ours.effect} {key}")
        for key in ("p_gg", "p_hf"):
            near(
                getattr(ours.univariate, key),
                theirs["univariate"].get(f"{key}_car"),
                f"{ours.effect} {key} (car)",
            )


def test_multivariate_and_mauchly(case) -> None:
    for ours, theirs in matched(case):
        assert (ours.multivariate is None) == (theirs["multivariate"] is None), ours.effect
        if ours.multivariate is not None:
            for key, value in theirs["multivariate"].items():
                near(getattr(ours.multivariate, key), value, f"{ours.effect} {key}")
        if ours.mauchly is not None:
            near(ours.mauchly.w, theirs["mauchly_w"], f"{ours.effect} W")
            near(mauchly_p_as_r_has_it(ours, case[1]), theirs["mauchly_p_r"], f"{ours.effect} Mauchly p")


def test_effect_sizes(case) -> None:
    for ours, theirs in matched(case):
        near(ours.eta_sq_partial, theirs["eta_sq_partial"], ours.effect)
        near(ours.eta_sq_generalized, theirs["eta_sq_generalized"], ours.effect)


def test_marginal_means(case) -> None:
    expected, result = case
    ours = {(m.effect, tuple(m.levels.items())): m for m in marginal_means(result)}
    assert len(ours) == len(expected["marginal_means"])
    for theirs in expected["marginal_means"]:
        mean = ours[theirs["effect"], tuple(theirs["levels"].items())]
        near(mean.mean, theirs["mean"], mean.effect)
        near(mean.se, theirs["se"], mean.effect)
        for bound, other in zip(mean.ci, theirs["ci"], strict=True):
            near(bound, other, mean.effect)


def test_pairs(case) -> None:
    expected, result = case
    ours = {}
    for effect in {pair["effect"] for pair in expected["pairwise"]}:
        for pair in pairs_of(result, effect.split(":")):
            ours[effect, pair.level_a, pair.level_b] = pair
    assert len(ours) == len(expected["pairwise"])
    for theirs in expected["pairwise"]:
        a, b = (theirs[key].replace(",", ":") for key in ("level_a", "level_b"))
        sign = 1 if (theirs["effect"], a, b) in ours else -1
        pair = ours[(theirs["effect"], a, b) if sign == 1 else (theirs["effect"], b, a)]
        near(sign * pair.difference, theirs["difference"], pair.effect)
        near(sign * pair.t, theirs["t"], pair.effect)
        for key in ("se", "df", "p", "p_bonferroni", "p_holm"):
            near(getattr(pair, key), theirs[key], f"{pair.effect} {key}")
        near((pair.ci if sign == 1 else pair.ci[::-1])[0], sign * theirs["ci"][0], pair.effect)
