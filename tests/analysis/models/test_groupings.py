"""Groups, covariates, crossed and nested groupings agree with lmerTest (tests/golden/r/crossed.R)."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.models.columns import ModelTerms, groupings
from analysis.models.mixed import fit_mixed
from analysis.models.ordinal import fit_ordinal
from analysis.models.random_part import MixedResult
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden" / "r"
EXPECTED = json.loads((GOLDEN / "crossed.json").read_text(encoding="utf-8"))
ROWS = pd.read_csv(GOLDEN / "crossed.csv")


@pytest.fixture(scope="module")
def fitted() -> MixedResult:
    return fit_mixed(
        ROWS,
        "participant",
        "rating",
        ["blur"],
        "clip",
        "all",
        between=["group"],
        covariates=["age"],
        random=["face", "lab/room"],
    )


def test_tests_agree_with_lmertest(fitted: MixedResult) -> None:
    assert fitted.reml_criterion == pytest.approx(EXPECTED["reml_criterion"], abs=1e-6)
    assert [e.effect for e in fitted.effects] == ["group", "blur", "group:blur", "age"]
    for theirs in EXPECTED["effects"]:
        ours = next(e for e in fitted.effects if e.effect == theirs["effect"])
        for key in ("f_value", "df_effect", "df_error", "p_value"):
            assert getattr(ours, key) == pytest.approx(theirs[key], rel=1e-4), (ours.effect, key)


def test_estimates_agree_with_lme4(fitted: MixedResult) -> None:
    ours = {(c.group, c.term): c.sd for c in fitted.components}
    names = {"participant": "intercept", "participant:blur": "blur"}
    for group, sd in EXPECTED["sds"].items():
        if group.startswith("participant"):
            # lme4's variance is that of a cell, ours that of contrasts of unit variance
            assert group in names
            continue
        key = ("residual", "") if group == "Residual" else (group, "intercept")
        assert ours[key] == pytest.approx(sd, rel=1e-4), group
    of_blur = EXPECTED["sds"]["participant:blur"]
    assert ours["participant", "blur"] * 3**0.5 == pytest.approx(of_blur, rel=1e-4)
    whole = EXPECTED["sds"]["participant"] ** 2 + of_blur**2 / 3
    assert ours["participant", "intercept"] ** 2 == pytest.approx(whole, rel=1e-4)
    age = next(c for c in fitted.coefficients if c.name == "age")
    theirs = next(c for c in EXPECTED["coefficients"] if c["name"] == "age")
    assert (age.estimate, age.se) == pytest.approx((theirs["estimate"], theirs["se"]), rel=1e-5)
    assert fitted.n_groups == {"participant": 30, "clip": 16, "face": 4, "lab": 3, "lab:room": 6}


def test_a_factor_of_one_level_a_person_goes_between(fitted: MixedResult) -> None:
    moved = fit_mixed(ROWS, "participant", "rating", ["blur", "group"], "clip", "none")
    declared = fit_mixed(ROWS, "participant", "rating", ["blur"], "clip", "none", between=["group"])
    assert "group: one level per participant" in moved.notes[0]
    assert moved.reml_criterion == pytest.approx(declared.reml_criterion, abs=1e-9)


def test_swapping_what_is_taken_out_first_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same model with each term taken out first, whichever is largest."""
    from analysis.models import reml

    first = fit_mixed(ROWS, "participant", "rating", ["blur"], "clip", "correlated", random=["face"])
    monkeypatch.setattr(reml.np, "argmax", lambda sizes: int(np.argsort(sizes)[0]))
    other = fit_mixed(ROWS, "participant", "rating", ["blur"], "clip", "correlated", random=["face"])
    monkeypatch.undo()
    assert other.reml_criterion == pytest.approx(first.reml_criterion, abs=1e-7)
    assert other.theta == pytest.approx(first.theta, abs=1e-4)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"between": ["face"]}, "'face' differs within participant"),
        ({"random": ["face/clip"]}, "'face:clip' groups the rows exactly as 'clip' does"),
        ({"covariates": ["rank"]}, "determined by the factors"),
        ({"random": ["row"]}, "every row has a different value for levels of 'row'"),
        ({"random": ["sage"]}, "no column is called 'sage'"),
    ],
)
def test_bad_input_is_one_clear_line(given: dict[str, list[str]], said: str) -> None:
    rows = ROWS.assign(rank=ROWS["blur"].map({"none": 0, "some": 1, "much": 2}), row=range(len(ROWS)))
    with pytest.raises(InputError, match=said):
        fit_mixed(rows, "participant", "rating", ["blur"], "clip", **given)


def test_the_ordinal_model_takes_groups_and_covariates() -> None:
    rows = ROWS.assign(rating=ROWS["rating"].round().clip(1, 7))
    fit = fit_ordinal(
        rows, "participant", "rating", ["blur"], "clip", "main", between=["group"], covariates=["age"]
    )
    assert [e.effect for e in fit.effects] == ["group", "blur", "group:blur", "age"]
    assert fit.coefficients[-1].name == "age"
    assert "group * blur + age" in fit.formula


def test_items_named_by_two_columns_are_told_apart_whatever_the_names_hold() -> None:
    rows = pd.DataFrame(
        {
            "who": [str(k // 4) for k in range(12)],
            "profile": ["a", "a/b", "a", "a/b"] * 3,
            "exemplar": ["b/c", "c", "c", "b/c"] * 3,
        }
    )
    terms = ModelTerms(participant="who", rating="", within=(), item=("profile", "exemplar"))
    items = groupings(rows, terms)[1]
    assert (len(items.names), len(set(items.codes))) == (4, 4)
    assert sorted(items.names) == ["a/b/b/c", "a/b/c", "a/b/c", "a/c"]
