"""The report's R script computes its tables anew: where R is, it agrees, and it finds a changed number."""

import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analysis.cli import app
from analysis.plans.result import analyse_cells
from analysis.read.long_csv import read_long_table
from analysis.report.r_script import r_files
from analysis.report.verify_with_r import verify_with_r
from analysis.within.cell_means import cell_table
from experiments.errors import InputError

GOLDEN = Path(__file__).parents[2] / "golden/r"
CALL = ("--participant", "participant", "--rating", "rating")


def has_afex() -> bool:
    """Whether R and the packages of the script are installed."""
    rscript = shutil.which("Rscript")
    call = [rscript or "", "-e", "library(afex); library(emmeans)"]
    return rscript is not None and subprocess.run(call, capture_output=True, check=False).returncode == 0


needs_r = pytest.mark.skipif(not has_afex(), reason="R with afex and emmeans is not installed")


def report(folder: Path, file: str, *options: str) -> Path:
    call = ["anova", str(GOLDEN / file), "--out", str(folder), *options]
    told = CliRunner().invoke(app, call)
    assert told.exit_code == 0, told.output
    return folder / "verify.R"


@needs_r
@pytest.mark.parametrize(
    ("file", "options"),
    [
        ("within/complete_2.csv", "--participant participant --rating rating --within A,B"),
        (
            "between/obk_age.csv",
            "--participant id --rating y --within phase,hour --between treatment,gender --covariate age",
        ),
        ("between/between_only.csv", "--participant id --rating y --between g,h --type 2"),
    ],
)
def test_r_agrees_with_every_number(tmp_path, file, options) -> None:
    said = verify_with_r([report(tmp_path, file, *options.split())])
    assert "Every number agrees with R." in said
    assert "DIFFER" not in said


@needs_r
def test_r_finds_a_changed_number(tmp_path) -> None:
    script = report(tmp_path, "within/complete_2.csv", *CALL, "--within", "A,B")
    data = (tmp_path / "cell-means.csv").read_text().splitlines()
    *cells, mean = data[1].split(",")
    data[1] = ",".join([*cells, str(float(mean) + 0.01)])
    (tmp_path / "cell-means.csv").write_text("\n".join(data))
    with pytest.raises(InputError, match="DIFFER") as caught:
        verify_with_r([script])
    assert "\n" not in str(caught.value)


def test_names_and_levels_that_r_would_read_as_code_stay_text(tmp_path) -> None:
    path = tmp_path / "odd.csv"
    rows = [
        f'p{i},"{level}",{i % 3 + k}' for i in range(6) for k, level in enumerate(('""); quit(', "b\\", "Ä"))
    ]
    path.write_text("\n".join(["id,my factor,y", *rows]), encoding="utf-8")
    data = read_long_table(path, "id", "y", ["my factor"])
    cells = cell_table(data.rows, "id", "y", ["my factor"])
    analysis = analyse_cells(cells, name="odd", title="a\nb", source="odd.csv", rating="y")
    script = r_files(analysis)["verify.R"].decode()
    assert script.startswith("# a b\n")
    assert 'levels = c("\\"); quit(", "b\\\\", "Ä"), labels = c("l1", "l2", "l3")' in script
    assert "Error(participant/(variable_1))" in script


def test_without_a_report_there_is_nothing_to_verify() -> None:
    call = ["anova", str(GOLDEN / "within/complete_1.csv"), *CALL, "--within", "A", "--verify-with-r"]
    told = CliRunner().invoke(app, call)
    assert isinstance(told.exception, InputError)
    assert "add e.g. --out results" in str(told.exception)
