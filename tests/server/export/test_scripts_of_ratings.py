"""The scripts of every design of ratings, run for real: F and pairs are those of our own tables."""

import re
import subprocess
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from analysis.plans.plan import plan_of, study_contents
from analysis.read.study_answers import load_csv
from experiments.declaration.experiment import Experiment
from experiments.load import load_experiment
from server.exports.psych_ds import APPLIED, script
from tests.analysis.ratings_file import Row, rows_of, simulate, write_export
from tests.analysis.report.r_process import needed, run_together
from tests.conftest import REPOSITORY

PEOPLE = {"mixed": 11, "groups": 21, "both": 13, "references": 6, "faces": 6, "one_missing": 8}


def design(name: str) -> Experiment:
    """A study of this design."""
    file = {"references": "dcr-demo", "faces": "faces-demo", "both": "exp1"}.get(name, "timing")
    study = load_experiment(str(REPOSITORY / "experiments" / f"{file}.toml"))
    between = {"groups": ("timing", "character"), "both": ("character", "blur")}
    groups = between.get(name, tuple(factor.name for factor in study.factors if factor.between))
    factors = (factor.model_copy(update={"between": factor.name in groups}) for factor in study.factors)
    return study.model_copy(update={"factors": tuple(factors)})


def in_own_group(study: Experiment) -> Callable[[Row], bool]:
    """Which rows a participant has: groups are of unequal sizes, two more in the first."""
    groups = [factor for factor in study.factors if factor.between]
    every = list(product(*([level.name for level in factor.levels] for factor in groups)))
    return lambda row: (
        tuple(row[factor.name] for factor in groups)
        == every[max(0, int(str(row["participant"])[1:]) - 2) % len(every)]
    )


def answers(name: str, study: Experiment, folder: Path) -> Path:
    """An export of ratings; of `one_missing` a participant lacks a cell."""
    fits, rows = in_own_group(study), []
    for row in rows_of(study, simulate(study, PEOPLE[name])):
        more: Row = {"scale": "rating", "synthetic": 1, "clip_sha256": row["stimulus"]}
        if name == "references":
            more["response"] = min(5, int(str(row["response"])))
        if name == "faces":
            more["face"] = ("alder", "birch", "cedar", "hazel")[int(str(row["exemplar"])) % 4]
        lacks = name == "one_missing" and row["participant"] == "P05" and row["timing"] == "none"
        if fits(row) and not lacks:
            rows.append(row | more)
    return write_export(folder / f"{name}.csv", study, rows)


@pytest.fixture(scope="module", params=list(PEOPLE))
def studied(request, tmp_path_factory) -> tuple[Path, Experiment, dict[str, Any]]:
    """The export, its study, and our own numbers."""
    study = design(request.param)
    path = answers(request.param, study, tmp_path_factory.mktemp(request.param))
    told = study_contents(study, load_csv(path, study, plan_of("clip_rating").reading))
    return path, study, told.numbers


def pairs_of(numbers: dict[str, Any]) -> list[dict[str, Any]]:
    return [pair for pair in numbers["pairwise"] if ":" not in pair["effect"]]


def test_the_python_script_gives_our_own_tables(studied) -> None:
    path, study, numbers = studied
    target = path.with_suffix(".py")
    target.write_text(script(study, "py", path.name), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", str(target)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    # `analysis run` applies all declared exclusions, the script those that rows or its arguments name.
    of_runs = [rule for rule in study.exclusions if not isinstance(rule, APPLIED)]
    assert ("note: this script does not apply these declared exclusions" in done.stderr) == bool(of_runs)
    for effect in numbers["effects"]:
        ours = effect["univariate"]
        found = re.search(rf"^\d+ +{effect['effect']} +(.*)$", done.stdout, re.MULTILINE)
        assert found is not None, done.stdout
        df1, df2, f, p, _, corrected, _ = map(float, found[1].split())
        assert (df1, df2) == (ours["df_effect"], ours["df_error"])
        assert (f, p) == pytest.approx((ours["f_value"], ours["p_value"]), abs=1e-4)
        assert corrected == pytest.approx(ours["p_gg"] or ours["p_value"], abs=1e-4)
    for pair in pairs_of(numbers):
        line = re.escape(f"{pair['level_a']} - {pair['level_b']}")
        found = re.search(rf"^\d+ +{line} +(.*)$", done.stdout, re.MULTILINE)
        assert found is not None, done.stdout
        difference, se, t, df, p, holm = map(float, found[1].split())
        assert df == pair["df"]
        ours = tuple(pair[key] for key in ("difference", "se", "t", "p", "p_holm"))
        assert (difference, se, t, p, holm) == pytest.approx(ours, abs=1e-4)


def test_the_r_script_gives_our_own_tables(studied) -> None:
    needed("afex", "emmeans", "lme4")
    path, study, numbers = studied
    target = path.with_suffix(".R")
    target.write_text(script(study, "R", path.name), encoding="utf-8")
    (said,) = run_together([target])
    assert "Linear mixed model" in said
    for effect in numbers["effects"]:
        found = re.search(rf"^\d+ +{effect['effect']} +[\d.]+, +[\d.]+ +[\d.]+ +([\d.]+)", said, re.MULTILINE)
        assert found is not None, said
        assert float(found[1]) == pytest.approx(effect["univariate"]["f_value"], abs=0.006)
    for pair in pairs_of(numbers):
        line = re.escape(f"{pair['level_a']} - {pair['level_b']}")
        found = re.search(rf"^ {line} +(.*)$", said, re.MULTILINE)
        assert found is not None, said
        ours = (pair["difference"], pair["se"], pair["df"], pair["t"], pair["p_holm"])
        assert tuple(map(float, found[1].split())) == pytest.approx(ours, abs=6e-3)
