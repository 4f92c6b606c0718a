"""Models written as formulas, against lmerTest and clmm (tests/golden/r/formula.R), and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.models.formula import model_options, parse_formula
from experiments.errors import InputError
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "tests" / "golden" / "r"
CROSSED = FOLDER / "crossed.csv"
GOLDEN = json.loads((FOLDER / "formula.json").read_text(encoding="utf-8"))


def _run(tmp_path: Path, command: str, file: Path, *options: str) -> dict[str, Any]:
    out = tmp_path / "out.json"
    ended = CliRunner().invoke(app, [command, str(file), *options, "--json", str(out)])
    if isinstance(ended.exception, InputError):
        raise ended.exception
    assert ended.exit_code == 0, ended.output
    numbers: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return numbers


@pytest.mark.parametrize("known", GOLDEN["mixed"], ids=lambda known: known["formula"])
def test_models_that_are_not_full_factorials_agree_with_lmer(tmp_path: Path, known: dict[str, Any]) -> None:
    result = _run(tmp_path, "mixed", CROSSED, "--formula", known["formula"])
    # the same model, fitted at least as well as BOBYQA does, which stops where the criterion is nearly flat
    assert known["reml"] - 1e-5 < result["reml_criterion"] < known["reml"] + 1e-6
    assert result["sigma"] == pytest.approx(known["sigma"], rel=2e-5)
    found = {frozenset(e["effect"].split(":")): e for e in result["effects"]}
    assert len(found) == len(known["tests"])
    for test in known["tests"]:
        own = found[frozenset(test["effect"].split(":"))]
        assert own["df_effect"] == test["df1"]
        assert (own["f_value"], own["df_error"]) == pytest.approx((test["f"], test["df2"]), rel=2e-3)
    intercept = result["coefficients"][0]["estimate"]
    assert intercept == pytest.approx(known["fixed"]["(Intercept)"], rel=1e-5)


def test_slopes_of_items_are_sds_in_the_covariates_unit(tmp_path: Path) -> None:
    formula = "rating ~ group + blur + age + (1 + blur | participant) + (1 + age || clip)"
    result = _run(tmp_path, "mixed", CROSSED, "--formula", formula)
    assert result["formula"] == formula
    components = {(c["group"], c["term"]): c["sd"] for c in result["components"]}
    known = next(one for one in GOLDEN["mixed"] if one["formula"] == formula)
    assert components["clip", "age"] == pytest.approx(known["sd_clip_age"][0], rel=1e-3)


def test_ordinal_models_agree_with_clmm(tmp_path: Path) -> None:
    file, known = FOLDER / "models" / "ordinal_three_levels.csv", GOLDEN["ordinal"]
    formula = "rating ~ A + B + (1 | participant) + (1 | clip)"
    result = _run(tmp_path, "ordinal", file, "--formula", formula, "--quadrature", "1")
    assert result["log_likelihood"] == pytest.approx(known["log_likelihood"], abs=1e-6)
    np.testing.assert_allclose([c["estimate"] for c in result["coefficients"]], known["beta"], atol=3e-5)
    formula = "rating ~ 1 + (1 | participant) + (1 | clip)"
    result = _run(tmp_path, "ordinal", file, "--formula", formula, "--quadrature", "1")
    assert result["log_likelihood"] == pytest.approx(known["empty"], abs=1e-6)
    assert result["effects"] == []


def test_a_formula_is_the_same_as_its_options(tmp_path: Path) -> None:
    options = ("--participant", "participant", "--rating", "rating", "--within", "blur", "--between", "group")
    by_options = _run(tmp_path, "mixed", CROSSED, *options, "--item", "clip", "--covariate", "age,age:group")
    formula = "rating ~ group*blur + age + age:group + (1 + blur || participant) + (1 | clip)"
    by_formula = _run(tmp_path, "mixed", CROSSED, "--formula", formula)
    for key in ("effects", "coefficients", "components", "reml_criterion"):
        assert by_formula[key] == by_options[key]


def test_formulas_are_read_as_r_reads_them() -> None:
    parsed = parse_formula("y ~ a*b*age + (1 + a | person) + (1 | lab/room) + (1 | clip)")
    names = [":".join(effect) for effect in parsed.effects]
    assert names == ["a", "b", "age", "a:b", "a:age", "b:age", "a:b:age"]
    assert parse_formula("y ~ a:a + (1 | person)").effects == (("a",),)
    header = ("y", "a", "b", "age", "person", "lab", "room", "clip")
    options = model_options(parsed, header, {"y", "age", "b"})
    assert options.factors == ("a",)
    assert options.covariates == ("b", "age", "a:b", "a:age", "b:age", "a:b:age")
    assert (options.participant, options.item, options.random) == ("person", ("clip",), ("lab/room",))
    assert (options.slopes, options.slope_effects) == ("correlated", ("a",))
    implied = model_options(parse_formula("y ~ a + (a | person)"), header, {"y", "age", "b"})
    assert (implied.slopes, implied.slope_effects) == ("correlated", ("a",))
    forced = model_options(parse_formula("y ~ factor(b) + (1 | person)"), header, {"y", "b"})
    assert (forced.factors, forced.covariates, forced.slopes) == (("b",), (), "none")


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("rating ~ grup + (1 | participant)", "'grup' in the formula is not a column; did you mean 'group'?"),
        ("rating ~ group", "has no random term; add one, such as (1 | participant)"),
        ("rating group", "expected a formula such as rating ~ a*b*age"),
        (
            "rating ~ group:blur + (1 | participant)",
            "has group:blur without group; add it, or write group*blur",
        ),
        (
            "rating ~ group + (1 + blur | participant)",
            "the slope of blur needs blur outside the brackets too",
        ),
        (
            "rating ~ blur^2 + (1 | participant)",
            "'blur^2' in 'rating ~ blur^2 + (1 | participant)' is not under",
        ),
        ("rating ~ blur + (0 + blur | participant)", "has a term without an intercept (0 +)"),
        ("rating ~ group + (1 + group | participant)", "it does not vary within one participant"),
        (
            "rating ~ blur + (1 + blur | participant) + (1 + blur | clip)",
            "slopes of one grouping may correlate; write (1 + blur || clip) for the other",
        ),
        (
            "rating ~ face + (1 | participant) + (1 + face || clip)",
            "the slope of face by clip is not determined: it does not vary within one clip",
        ),
        (
            "rating ~ blur + (1 | participant) + (1 + blur || lab/room)",
            "the nested grouping lab/room has no slopes",
        ),
    ],
)
def test_wrong_formulas_are_one_line(tmp_path: Path, formula: str, said: str) -> None:
    with pytest.raises(InputError) as error:
        _run(tmp_path, "mixed", CROSSED, "--formula", formula)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_formula_of_an_ordinal_model_takes_slopes_of_people_and_of_items(tmp_path: Path) -> None:
    known = json.loads((FOLDER / "item_slopes.json").read_text(encoding="utf-8"))
    formula = "rating ~ a + (1 + a || participant) + (1 + a || clip)"
    result = _run(tmp_path, "ordinal", FOLDER / "item_slopes.csv", "--formula", formula)
    assert result["log_likelihood"] == pytest.approx(known["log_likelihood"], abs=1e-5)
    assert result["formula"].endswith("+ (1 | clip) + (0 + a | clip), logit")


def test_a_formula_goes_with_no_other_option_for_columns(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--formula names all columns and slopes; remove the other options"):
        _run(tmp_path, "mixed", CROSSED, "--formula", "rating ~ 1 + (1 | clip)", "--within", "blur")
    formula = "rating ~ blur + (1 | participant) + (1 | clip) + (1 | lab)"
    with pytest.raises(InputError, match="participants and one more grouping; remove lab"):
        _run(tmp_path, "ordinal", CROSSED, "--formula", formula)
    with pytest.raises(InputError, match="slopes of the ordinal model cannot correlate"):
        _run(tmp_path, "ordinal", CROSSED, "--formula", "rating ~ blur + (1 + blur | participant)")


def _levels(people: int, levels: int, trials: int) -> pd.DataFrame:
    random = np.random.default_rng(4)
    rows = [(f"p{p:02}", f"l{k}", t) for p in range(people) for k in range(levels) for t in range(trials)]
    table = pd.DataFrame(rows, columns=["id", "face", "trial"])
    return table.assign(score=random.normal(size=len(table)).round(3))


def test_ten_levels_in_twelve_people_are_named(tmp_path: Path) -> None:
    file = tmp_path / "ratings.csv"
    _levels(12, 10, 3).to_csv(file, index=False)
    result = _run(tmp_path, "mixed", file, "--formula", "score ~ face + (1 + face | id)")
    assert any(
        "55 variances and covariances are estimated from 12 participants" in n for n in result["notes"]
    )
    _levels(10, 10, 3).to_csv(file, index=False)
    with pytest.raises(InputError, match="10 participants do not determine the covariances of 10 correlated"):
        _run(tmp_path, "mixed", file, "--formula", "score ~ face + (1 + face | id)")
    _levels(12, 10, 1).to_csv(file, index=False)
    with pytest.raises(InputError, match="with one rating per cell it is the residual"):
        _run(tmp_path, "mixed", file, "--formula", "score ~ face + (1 + face || id)")
