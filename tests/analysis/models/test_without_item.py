"""Models of participants alone agree with lmerTest and ordinal (tests/golden/r/without_item.R)."""

import json
from pathlib import Path

import pandas as pd
import pytest

from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
EXPECTED = json.loads((GOLDEN / "without_item.json").read_text(encoding="utf-8"))


def test_the_linear_model() -> None:
    theirs = EXPECTED["mixed"]
    rows = pd.read_csv(GOLDEN / "models" / "mixed_two_by_two.csv")
    ours = fit_mixed(rows, "participant", "rating", ["A", "B"], slopes="none")
    assert ours.reml_criterion == pytest.approx(theirs["reml"], rel=1e-8)
    assert ours.components[0].sd == pytest.approx(theirs["sd_participant"], rel=1e-5)
    assert [c.group for c in ours.components] == ["participant", "residual"]
    assert "clip" not in ours.formula
    for effect in theirs["effects"]:
        mine = next(e for e in ours.effects if e.effect == effect["effect"])
        for key in ("f_value", "df_error", "p_value"):
            assert getattr(mine, key) == pytest.approx(effect[key], rel=1e-5), (effect["effect"], key)


def test_the_ordinal_model() -> None:
    theirs = EXPECTED["ordinal"]
    rows = pd.read_csv(GOLDEN / "models" / "ordinal_small.csv")
    factors = [name for name in rows.columns if name in "ABCD"]
    ours = fit_ordinal(rows, "participant", "rating", factors, quadrature=1)
    assert ours.log_likelihood == pytest.approx(theirs["log_likelihood"], rel=1e-6)
    assert ours.sd_participant == pytest.approx(theirs["sd_participant"], rel=1e-3)
    assert [c.estimate for c in ours.coefficients] == pytest.approx(theirs["beta"], abs=1e-3)
    assert ours.sd_item == 0


def test_correlated_slopes_of_three_levels_have_names_of_their_own() -> None:
    rows = pd.read_csv(GOLDEN / "models" / "mixed_three_levels.csv")
    factors = [name for name in rows.columns if name in "ABCD"]
    components = fit_mixed(rows, "participant", "rating", factors, "clip", "correlated").components
    names = [(c.group, c.term) for c in components]
    assert len(set(names)) == len(names)


def test_a_singular_fit_names_what_is_zero() -> None:
    rows = pd.read_csv(GOLDEN / "models" / "mixed_two_by_two.csv")
    # a random label: participants cannot differ in its effect
    rows["C"] = [("x", "y")[(7 * i + i // 3) % 2] for i in range(len(rows))]
    fit = fit_mixed(rows, "participant", "rating", ["C"], "clip", "all")
    assert fit.singular == any("slope variance of participant C is" in note for note in fit.notes)
    assert fit.singular
