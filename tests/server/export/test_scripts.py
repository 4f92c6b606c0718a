"""The generated scripts, run for real: R where there is one with its packages, Python with this one."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from experiments.declaration.experiment import Experiment
from experiments.load import load_experiment
from experiments.rules import DropFailedPlays, DropSlowTrials, ExcludeIncomplete
from server.exports.psych_ds import LANGUAGES, script
from tests.analysis.ratings_file import rows_of, simulate, write_export
from tests.analysis.report.r_process import needed

EXP3 = load_experiment("exp3")
SCALE_AND_PLAY = {"scale": "rating", "synthetic": 1}
NOTHING_LEFT = "no answer to a main trial is left by runs that count: nothing to analyse yet"


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scripts")
    rows = [row | SCALE_AND_PLAY for row in rows_of(EXP3, simulate(EXP3, 8))]
    rows = [row | {"clip_sha256": f"{row['stimulus']}"} for row in rows]
    return write_export(folder / "exp3.csv", EXP3, rows)


def run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def own_f(answers: Path, study: Experiment = EXP3) -> float:
    """F of the first effect by this repository's own analysis of the same file."""
    from analysis.plans.plan import plan_of, study_contents
    from analysis.read.study_answers import load_csv

    contents = study_contents(study, load_csv(answers, study, plan_of("clip_rating").reading))
    return float(contents.numbers["effects"][0]["univariate"]["f_value"])


def test_the_python_script_gives_our_own_f(answers: Path) -> None:
    target = answers.with_suffix(".py")
    target.write_text(script(EXP3, "py", answers.name), encoding="utf-8")
    said = run([sys.executable, "-W", "ignore", str(target)])
    assert "8 participants" in said
    line = next(line for line in said.splitlines() if line.startswith("0  lower_lid"))
    found = float(line.split()[4])
    assert found == pytest.approx(own_f(answers), abs=5e-4)


@pytest.fixture(scope="module")
def two_series(answers: Path) -> Path:
    """The answers, and those of other people to an earlier version on another scale."""
    newest = pd.read_csv(answers, dtype=str, keep_default_na=False)
    older = newest.assign(response=[str(1 + row % 5) for row in range(len(newest))])
    older = older.assign(data_series="1", participant="old" + older["participant"], run="old" + older["run"])
    file = answers.with_name("two-series.csv")
    pd.concat([older, newest.assign(data_series="2")]).to_csv(file, index=False)
    return file


def test_the_python_script_takes_the_newest_data_series(answers: Path, two_series: Path) -> None:
    said = []
    for file in (answers, two_series):
        target = file.with_suffix(".py")
        target.write_text(script(EXP3, "py", file.name), encoding="utf-8")
        said.append(run([sys.executable, "-W", "ignore", str(target)]))
    assert said[0] == said[1]


@pytest.mark.parametrize(("series", "kept"), [(1, "1"), (2, "2"), (3, "2"), (None, "2")])
def test_the_python_script_takes_the_data_series_of_its_declaration(
    two_series: Path, tmp_path: Path, series: int | None, kept: str
) -> None:
    """A version that measures as an earlier one goes on with its series, which then is not the newest."""
    rows = pd.read_csv(two_series, dtype=str, keep_default_na=False)
    alone = rows[rows["data_series"] == kept].drop(columns="data_series")
    alone.to_csv(tmp_path / "alone.csv", index=False)
    said = []
    for file in (two_series, tmp_path / "alone.csv"):
        target = tmp_path / "script.py"
        target.write_text(script(EXP3, "py", file.name, series=series), encoding="utf-8")
        said.append(run([sys.executable, "-W", "ignore", str(target), str(file)]))
    assert said[0] == said[1]


@pytest.fixture(scope="module")
def three_origins(answers: Path) -> Path:
    """The answers as of participants, and other ones of pilots and simulations, some in a newer series."""
    mine = pd.read_csv(answers, dtype=str, keep_default_na=False).assign(run_origin="participant")
    parts = [mine]
    for origin, series in (("pilot", "1"), ("simulated", "2")):
        other = mine.assign(response="7", run_origin=origin, data_series=series)
        parts.append(other.assign(participant=origin + other["participant"], run=origin + other["run"]))
    file = answers.with_name("three-origins.csv")
    pd.concat(parts).to_csv(file, index=False)
    return file


@pytest.mark.parametrize("kept", [("participant", "pilot", "simulated"), ("pilot", "simulated")])
def test_the_python_script_takes_participants_before_pilots_before_simulations(
    three_origins: Path, tmp_path: Path, kept: tuple[str, ...]
) -> None:
    rows = pd.read_csv(three_origins, dtype=str, keep_default_na=False)
    rows = rows[rows["run_origin"].isin(kept)]
    first = rows["run_origin"] == kept[0]
    rows.to_csv(tmp_path / "all.csv", index=False)
    rows[first].to_csv(tmp_path / "alone.csv", index=False)
    target = tmp_path / "script.py"
    target.write_text(script(EXP3, "py", "all.csv", series=2), encoding="utf-8")
    every, alone = (
        subprocess.run(
            [sys.executable, "-W", "ignore", str(target), str(tmp_path / name)],
            capture_output=True,
            text=True,
            check=True,
        )
        for name in ("all.csv", "alone.csv")
    )
    assert every.stdout == alone.stdout
    said = f"Only answers of origin {kept[0]}; ignored rows of other origins: {(~first).sum()}."
    assert said in every.stderr
    assert "origin" not in alone.stderr


@pytest.fixture(scope="module")
def older_origins(answers: Path) -> Path:
    """The answers as of participants, and others, by the columns that have the origin in older exports."""
    mine = pd.read_csv(answers, dtype=str, keep_default_na=False).assign(phase="live", synthetic="0")
    mine = mine.drop(columns=["run_origin", "data_series"], errors="ignore")
    parts = [mine]
    for phase, synthetic in (("pilot", "0"), ("live", "1")):
        other = mine.assign(response="7", phase=phase, synthetic=synthetic)
        who = f"{phase}{synthetic}"
        parts.append(other.assign(participant=who + other["participant"], run=who + other["run"]))
    file = answers.with_name("older-origins.csv")
    pd.concat(parts).to_csv(file, index=False)
    return file


@pytest.mark.parametrize("empty_column", [False, True])
def test_the_python_script_knows_the_origins_of_older_exports(
    older_origins: Path, tmp_path: Path, empty_column: bool
) -> None:
    file, target = tmp_path / "older.csv", tmp_path / "script.py"
    rows = pd.read_csv(older_origins, dtype=str, keep_default_na=False)
    (rows.assign(run_origin="") if empty_column else rows).to_csv(file, index=False)
    target.write_text(script(EXP3, "py", file.name), encoding="utf-8")
    said = run([sys.executable, "-W", "error", str(target)])
    assert "8 participants" in said
    line = next(line for line in said.splitlines() if line.startswith("0  lower_lid"))
    assert float(line.split()[4]) == pytest.approx(own_f(file), abs=5e-4)


@pytest.mark.parametrize("more", ["two_series", "three_origins", "older_origins"])
def test_the_r_script_takes_the_newest_series_and_participants_first(
    answers: Path, request: pytest.FixtureRequest, more: str
) -> None:
    needed("afex", "emmeans", "lme4")
    said = []
    for file in (answers, request.getfixturevalue(more)):
        target = file.with_suffix(".R")
        target.write_text(script(EXP3, "R", file.name), encoding="utf-8")
        said.append(run(["Rscript", str(target)]))
    assert f_of_r(said[0]) == f_of_r(said[1])


@pytest.fixture(scope="module")
def impure(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Experiment]:
    """Answers of which declared rules leave some out, as their rows show; those would change F."""
    rules = (ExcludeIncomplete(), DropFailedPlays(), DropSlowTrials(above_ms=9000))
    study = EXP3.model_copy(update={"exclusions": rules})
    rows = [
        row | SCALE_AND_PLAY | {"clip_sha256": row["stimulus"]} for row in rows_of(study, simulate(study, 9))
    ]
    unfinished = rows[0]["run"]
    for number, row in enumerate(rows):
        row["run_status"] = "withdrawn" if row["run"] == unfinished else "complete"
        row["verdict"] = "failed" if number % 7 == 0 else "good"
        row["rt"] = 9001 if number % 11 == 0 else 700
        row["clip_sha256"] = row["stimulus"]
        if row["run"] == unfinished or number % 7 == 0 or number % 11 == 0:
            row["response"] = 7
    # A second visit of a person who finished the first; its name sorts before.
    second = [row for row in rows if row["run"] == rows[-1]["run"]]
    later = {"run": "again", "response": 7, "saved_at": "2026-11-02T09:00:00Z"}
    rows = [row | {"saved_at": "2026-11-01T09:00:00Z"} for row in rows] + [row | later for row in second]
    return write_export(tmp_path_factory.mktemp("rules") / "rules.csv", study, rows), study


def test_the_python_script_leaves_out_what_its_rows_show(impure: tuple[Path, Experiment]) -> None:
    path, study = impure
    target = path.with_suffix(".py")
    target.write_text(script(study, "py", path.name), encoding="utf-8")
    said = run([sys.executable, "-W", "error", str(target)])
    assert "8 participants" in said
    line = next(line for line in said.splitlines() if line.startswith("0  lower_lid"))
    assert float(line.split()[4]) == pytest.approx(own_f(path, study), abs=5e-4)


def test_the_r_script_leaves_out_what_its_rows_show(impure: tuple[Path, Experiment]) -> None:
    needed("afex", "emmeans", "lme4")
    path, study = impure
    target = path.with_suffix(".R")
    target.write_text(script(study, "R", path.name), encoding="utf-8")
    assert f_of_r(run(["Rscript", str(target)])) == pytest.approx(own_f(path, study), abs=0.006)


def test_the_r_script_gives_our_own_f(answers: Path) -> None:
    needed("afex", "emmeans", "lme4")
    target = answers.with_suffix(".R")
    target.write_text(script(EXP3, "R", answers.name), encoding="utf-8")
    said = run(["Rscript", str(target)])
    assert f_of_r(said) == pytest.approx(own_f(answers), abs=0.006)
    assert "contrast" in said
    assert "Linear mixed model" in said


def f_of_r(said: str) -> float:
    """F of the first effect as afex prints it, of eight participants."""
    assert "8 participants" in said
    # 1 lower_lid 2.28, 15.93 0.43 5.52 * .441 .013: the corrected df, the mean square error, F.
    line = re.search(r"^1 +lower_lid +[\d.]+, +[\d.]+ +[\d.]+ +([\d.]+)", said, re.MULTILINE)
    assert line is not None, said
    return float(line[1])


@pytest.mark.parametrize("name", ["exp1", "pairs-demo", "sliders-demo", "threshold-demo", "plane-demo"])
def test_a_script_says_that_there_is_nothing_to_analyse(name: str, tmp_path: Path) -> None:
    columns = "participant,run,run_status,kind,excluded,trial_index,play,scale,response,winner,counts,correct"
    (tmp_path / "data.csv").write_text(
        f"{columns},verdict,rt,run_origin\nP1,1,complete,practice,0,0,1,rating,3,left,0,1,good,700,\n",
        encoding="utf-8",
    )
    target = tmp_path / "script.py"
    target.write_text(script(declared(name), "py", "data.csv"), encoding="utf-8")
    done = subprocess.run([sys.executable, str(target)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("data.csv: " + NOTHING_LEFT)
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr  # the column of origins is empty: numbers, for pandas
    assert NOTHING_LEFT in script(declared(name), "R", "data.csv")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ["exp1", "exp2", "pairs-demo", "sliders-demo", "threshold-demo"])
def test_every_experiment_has_scripts_that_parse(name: str, language: str, tmp_path: Path) -> None:
    text = script(declared(name), language, "data.csv")  # type: ignore[arg-type]
    assert "data.csv" in text
    if language == "py":
        compile(text, name, "exec")
    elif shutil.which("Rscript"):
        (tmp_path / "a.R").write_text(text, encoding="utf-8")
        run(["Rscript", "-e", f'invisible(parse("{tmp_path}/a.R"))'])


def declared(name: str) -> Experiment:
    folder = Path(load_experiment.__code__.co_filename).parent
    return load_experiment(str(folder / f"{name}.toml"))


def test_random_factors_are_random_in_the_script_and_not_compared() -> None:
    written = script(load_experiment("faces-demo"), "R", "ratings.csv")
    assert 'within <- c("profile")' in written
    assert '"(1 | participant)", "(1 | `face`)", "(1 | `face`:`profile`)"' in written
