"""Models written as formulas, against lmerTest and clmm (tests/golden/r/formula.R), and what is refused."""

import json
import shutil
import subprocess
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

needs_r = pytest.mark.skipif(shutil.which("Rscript") is None, reason="R is not installed")


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


@pytest.fixture(scope="module")
def awkward(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ratings whose factor has numbers as levels and whose columns have names that R puts in backticks."""
    random = np.random.default_rng(7)
    design = [(p, c, d, k) for p in range(12) for c in range(8) for d in (10, 20, 30) for k in "xy"]
    table = pd.DataFrame(design, columns=["person no.", "clip", "delay", "kind"])
    table["face"] = [f"f{c % 4}" for c in table["clip"]]
    table["trial"] = random.permuted(np.tile(np.arange(48), (12, 1)), axis=1).ravel()
    spread = random.normal(size=(12, 3))[table["person no."]]
    latent = spread[:, 0] + 0.05 * spread[:, 1] * table["delay"] + 0.04 * spread[:, 2] * table["trial"]
    latent += 0.4 * random.normal(size=(8, 2))[table["clip"], (table["kind"] == "x").astype(int)]
    table["my score"] = np.clip(np.round(4 + latent + random.normal(size=len(table))), 1, 7).astype(int)
    path = tmp_path_factory.mktemp("awkward") / "ratings.csv"
    table.to_csv(path, index=False)
    return path


NAMED = ("--participant", "person no.", "--rating", "my score")


@pytest.mark.parametrize(
    ("command", "options", "shown"),
    [
        (
            "mixed",
            (*NAMED, "--within", "delay,kind", "--item", "clip", "--slopes", "all"),
            "`my score` ~ factor(delay) * kind + (1 + factor(delay) + kind + factor(delay):kind || "
            "`person no.`) + (1 | clip)",
        ),
        (
            "mixed",
            (*NAMED, "--within", "kind", "--covariate", "trial,trial:kind", "--item", "face,clip"),
            "`my score` ~ kind + trial + kind:trial + (1 + trial | `person no.`) + (0 + kind + kind:trial || "
            "`person no.`) + (1 | face:clip)",
        ),
        (
            "mixed",
            (*NAMED, "--within", "delay", "--random", "face/clip", "--slopes", "correlated"),
            "`my score` ~ factor(delay) + (1 + factor(delay) | `person no.`) + (1 | face) + (1 | face:clip)",
        ),
        (
            "ordinal",
            (*NAMED, "--within", "delay", "--covariate", "trial", "--item", "clip", "--slopes", "all"),
            "`my score` ~ factor(delay) + trial + (1 + trial + factor(delay) || `person no.`) + (1 | clip)",
        ),
    ],
)
def test_a_printed_formula_is_read_as_the_same_model(
    tmp_path: Path, awkward: Path, command: str, options: tuple[str, ...], shown: str
) -> None:
    by_options = _run(tmp_path, command, awkward, *options)
    assert by_options["formula"] == shown
    pasted = _run(tmp_path, command, awkward, "--formula", shown)
    assert pasted["formula"] == shown
    fit = "reml_criterion" if command == "mixed" else "log_likelihood"
    assert pasted[fit] == pytest.approx(by_options[fit], abs=1e-6)
    for one, known in zip(pasted["effects"], by_options["effects"], strict=True):
        assert one.pop("effect") == known.pop("effect")
        assert one == pytest.approx(known, rel=1e-4)
    sds = [
        [(c["group"], c["term"], round(c["sd"], 4)) for c in r["components"]] for r in (pasted, by_options)
    ]
    assert sds[0] == sds[1]


def test_slopes_of_covariates_correlate_as_the_bars_say(tmp_path: Path, awkward: Path) -> None:
    def criterion(random: str) -> float:
        formula = f"`my score` ~ trial + {random} + (1 | clip)"
        result = _run(tmp_path, "mixed", awkward, "--formula", formula)
        assert random in result["formula"]
        return float(result["reml_criterion"])

    apart = criterion("(1 + trial || `person no.`)")
    assert criterion("(1 + trial | `person no.`)") < apart - 0.01
    written_apart = "`my score` ~ trial + (1 | `person no.`) + (0 + trial | `person no.`) + (1 | clip)"
    assert _run(tmp_path, "mixed", awkward, "--formula", written_apart)["reml_criterion"] == apart


@needs_r
@pytest.mark.parametrize(
    ("command", "random"),
    [
        ("mixed", "(1 + trial || person) + (1 + kind || clip)"),
        ("mixed", "(1 + trial | person) + (0 + kind || person) + (1 | face:clip)"),
        ("ordinal", "(1 | person) + (0 + kind | person)"),
    ],
)
def test_r_reads_a_printed_formula_as_the_same_model_where_columns_are_numbers(
    tmp_path: Path, awkward: Path, command: str, random: str
) -> None:
    """As a column of +1 and -1 a factor's || means in lmer what it means here; clmm knows no ||."""
    table = pd.read_csv(awkward).rename(columns={"my score": "score", "person no.": "person"})
    table["kind"] = np.where(table["kind"] == "x", 1, -1)
    table["trial"] -= table["trial"].mean()
    file, out = tmp_path / "table.csv", tmp_path / "likelihood.txt"
    table.to_csv(file, index=False)
    formula = f"score ~ kind + trial + {random}"
    result = _run(tmp_path, command, file, "--formula", formula)
    pasted = result["formula"] if command == "mixed" else formula
    fit = f"REMLcrit(lmer({pasted}, d))" if command == "mixed" else f"logLik(clmm({pasted}, d))"
    script = (
        "suppressPackageStartupMessages({library(lme4); library(ordinal)}); "
        f"d <- read.csv({json.dumps(str(file))}); "
        "for (name in c('person', 'face', 'clip')) d[[name]] <- factor(d[[name]]); "
        f"{'d$score <- factor(d$score); ' if command == 'ordinal' else ''}"
        f"cat(format(as.numeric({fit}), digits = 12), file = {json.dumps(str(out))})"
    )
    subprocess.run([shutil.which("Rscript") or "", "--vanilla", "-e", script], check=True, timeout=300)
    own = result["reml_criterion" if command == "mixed" else "log_likelihood"]
    assert own == pytest.approx(float(out.read_text()), abs=2e-3)


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
    both = model_options(parse_formula("y ~ a + (1 | clip) + (1 | person:room)"), header, {"y"})
    assert (both.participant, both.item, both.random) == ("clip", ("person", "room"), ())
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
        ("rating ~ 0 + blur + (1 | participant)", "has no intercept (0 +), which is not supported"),
        ("rating ~ blur + (0 + blur || participant)", "has no intercepts by participant; write one"),
        ("rating ~ blur + (1 | clip) + (1 + blur | clip)", "has 2 intercepts by clip; write one"),
        (
            "rating ~ blur + (1 | participant) + (0 + blur | participant)",
            "gives each factor level a separate variance. Write (0 + blur || participant)",
        ),
        (
            "rating ~ blur + age + (1 | clip) + (0 + blur + age | clip)",
            "correlate without the intercept (0 +), which is not supported",
        ),
        (
            "rating ~ blur + age + (1 + blur | participant) + (0 + age || participant)",
            "only columns of numbers may have slopes by participant that correlate next to others",
        ),
        ("rating ~ `my blur` + (1 | participant)", "'my blur' in the formula is not a column"),
        ("rating ~ `my blur`^2 + (1 | participant)", "'`my blur`^2' in 'rating ~ `my blur`^2 + (1"),
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
    assert result["formula"] == formula


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


def test_a_grouping_of_participant_and_clip_may_come_before_the_clip(tmp_path: Path) -> None:
    """(1 | participant:clip) is common in R: what one participant thinks of one clip."""
    last = "rating ~ group + (1 | participant) + (1 | clip) + (1 | participant:clip)"
    first = "rating ~ group + (1 | participant) + (1 | participant:clip) + (1 | clip)"
    one, other = (_run(tmp_path, "mixed", CROSSED, "--formula", text) for text in (last, first))
    assert other["formula"] == first
    assert other["reml_criterion"] == pytest.approx(one["reml_criterion"], abs=1e-8)


def test_correlated_slopes_of_a_joined_grouping_are_refused_whatever_the_order() -> None:
    """Another grouping before it would not help: the one whose slopes correlate is the participants."""
    formula = parse_formula("rating ~ blur + (1 | participant) + (1 + blur | face:clip)")
    columns = ["rating", "blur", "participant", "face", "clip"]
    with pytest.raises(InputError, match=r"slopes by face:clip cannot correlate; write \|\| for"):
        model_options(formula, columns, {"blur"})
