"""The R scripts of a report's models: where R is, lme4 and clmm agree with what the report says."""

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pandas as pd
import pytest

from analysis.plans.clip_rating import PLAN, READING, analyse
from analysis.plans.plan import prepare
from analysis.plans.sensitivity import mixed_model, ordinal_model
from analysis.read.study_answers import load_csv
from analysis.report.contents import Section
from experiments.declaration.experiment import Experiment
from experiments.load import load_experiment
from tests.analysis.ratings_file import rows_of, simulate, write_export
from tests.analysis.report.r_process import needed, run_together

EXP1, EXP3 = load_experiment("exp1"), load_experiment("exp3")


def first_levels(levels: int) -> Experiment:
    """Exp 3 with the first levels of its factor, and without exclusions."""
    factor = EXP3.factors[0].model_copy(update={"levels": EXP3.factors[0].levels[:levels]})
    return EXP3.model_copy(update={"factors": (factor, *EXP3.factors[1:]), "exclusions": ()})


def sections(folder: Path, experiment: Experiment, trials: int = 3) -> tuple[Section, Section]:
    """The models of an experiment, rated by seven people."""
    ratings = rows_of(experiment, simulate(experiment, 7, trials=trials))
    file = write_export(folder / "r.csv", experiment, ratings)
    analysis = analyse(prepare(experiment, PLAN, load_csv(file, experiment, READING)))
    return mixed_model(analysis), ordinal_model(analysis)


def written(section: Section, folder: Path, key: str = "") -> list[Path]:
    files = section.beside(key)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return [folder / name for name in files]


def test_levels_are_in_the_order_of_the_model(tmp_path) -> None:
    experiment = first_levels(2)
    factor = experiment.factors[0]
    export = write_export(
        tmp_path / "r.csv", experiment, rows_of(experiment, simulate(experiment, 7, trials=3))
    )
    analysis = analyse(prepare(experiment, PLAN, load_csv(export, experiment, READING)))
    first = mixed_model(analysis).beside("")
    backwards = sorted(analysis.exclusions.rows[factor.name].unique(), reverse=True)
    rows = analysis.exclusions.rows
    ordered = rows.assign(**{factor.name: pd.Categorical(rows[factor.name], backwards, ordered=True)})
    turned = replace(analysis, exclusions=replace(analysis.exclusions, rows=ordered))
    second = mixed_model(turned).beside("")
    columns = [
        pd.read_csv(BytesIO(next(text for name, text in files.items() if name.endswith(".csv"))))["f1"]
        for files in (first, second)
    ]
    assert columns[0].tolist() == (3 - columns[1]).tolist()


def altered_coefficient(script: Path) -> Path:
    """The script with one coefficient changed, in what is printed and where the likelihood is taken."""
    text = script.read_text(encoding="utf-8")
    (value,) = re.findall(r"^ordinal coefficient,f11,(.*)$", text, re.MULTILINE)
    assert text.count(value) == 2
    script.write_text(text.replace(value, repr(float(value) * 1.001)), encoding="utf-8")
    return script


@pytest.fixture(scope="module")
def of_r(tmp_path_factory) -> dict[str, str]:
    """What R says of the models of two levels, of four, and of an F that was changed."""
    needed("lme4", "lmerTest", "ordinal")
    folders = ("two", "four", "factors", "changed", "turned")
    two, four, factors, changed, turned = (tmp_path_factory.mktemp(name) for name in folders)
    mixed, ordinal = sections(two, first_levels(2))
    shared, shared_ordinal = sections(four, first_levels(4))
    _, of_four_factors = sections(factors, EXP1.model_copy(update={"exclusions": ()}), trials=2)
    altered = written(mixed, changed)[0]
    text = altered.read_text(encoding="utf-8")
    line = re.findall(r"^mixed F,f1,.*$", text, re.MULTILINE)[0]
    other = f"mixed F,f1,{float(line.split(',')[-1]) * 1.01!r}"
    altered.write_text(text.replace(line, other), encoding="utf-8")
    scripts = [
        written(mixed, two)[0],
        written(ordinal, two)[0],
        written(shared, four, "eeriness")[0],
        written(shared_ordinal, four)[0],
        written(of_four_factors, factors)[0],
        altered,
        altered_coefficient(written(ordinal, turned)[0]),
    ]
    assert {path.suffix for path in scripts} == {".R"}
    models = ("mixed", "ordinal", "shared", "shared ordinal", "four factors", "changed", "changed ordinal")
    return dict(zip(models, run_together(scripts), strict=True))


@pytest.mark.parametrize(
    ("model", "tables"),
    [
        ("mixed", ("mixed criterion", "mixed F", "mixed residual SD")),
        ("ordinal", ("ordinal likelihood", "ordinal se")),
        ("shared", ("mixed criterion", "mixed F")),
        ("shared ordinal", ("ordinal likelihood", "ordinal coefficient", "ordinal SD")),
        ("four factors", ("ordinal likelihood", "ordinal threshold", "ordinal coefficient", "ordinal se")),
    ],
)
def test_r_agrees_with_models_also_where_contrasts_share_a_variance(of_r, model, tables) -> None:
    assert "Every number agrees with R." in of_r[model], of_r[model]
    for table in tables:
        assert re.search(rf"^{table} .*agree$", of_r[model], re.MULTILINE), of_r[model]


def test_r_finds_a_changed_f_and_a_changed_coefficient(of_r) -> None:
    assert re.search(r"^mixed F .*DIFFER$", of_r["changed"], re.MULTILINE)
    assert re.search(r"^ordinal coefficient .*DIFFER$", of_r["changed ordinal"], re.MULTILINE)


def test_no_name_is_in_code(tmp_path) -> None:
    mixed, ordinal = sections(tmp_path, first_levels(2))
    for path in written(mixed, tmp_path, "a") + written(ordinal, tmp_path, "a"):
        assert path.name.startswith("a-")
        text = path.read_text(encoding="utf-8")
        assert "lower_lid" not in text
        assert "P00" not in text
