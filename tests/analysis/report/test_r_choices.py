"""The R scripts of reports of pairs and thresholds: where R is, they agree, and they see a changed number."""

import re
import shutil
from pathlib import Path

import pytest

from analysis.plans.paired_comparison import READING as PAIRS
from analysis.plans.plan import study_contents
from analysis.plans.threshold import READING as THRESHOLDS
from analysis.read.study_answers import load_csv
from analysis.report.contents import Contents
from analysis.report.r_models import verify_with_r
from experiments.errors import InputError
from experiments.load import load_experiment
from tests.analysis.comparisons_file import compare, write_comparisons
from tests.analysis.plans.test_paired_comparison import ABILITIES, DEMO
from tests.analysis.plans.test_threshold import EXPERIMENT, rows_of, write
from tests.conftest import REPOSITORY

needs_r = pytest.mark.skipif(shutil.which("Rscript") is None, reason="R is not installed")


def of_pairs(folder: Path, ties: float = 0.0) -> Contents:
    rows = compare(DEMO, ABILITIES, 12)
    if ties:
        for row in rows[:: round(1 / ties)]:
            row["winner"] = "tie"
    experiment = load_experiment(str(REPOSITORY / "experiments" / "pairs-demo.toml"))
    return study_contents(experiment, load_csv(write_comparisons(folder / "c.csv", rows), experiment, PAIRS))


def of_thresholds(folder: Path) -> Contents:
    return study_contents(EXPERIMENT, load_csv(write(folder / "t.csv", rows_of()), EXPERIMENT, THRESHOLDS))


def written(contents: Contents, folder: Path) -> Path:
    files = contents.parts[0].beside("")
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder / "verify.R"


@needs_r
@pytest.mark.parametrize("ties", [0.0, 0.2])
def test_r_agrees_with_abilities_differences_and_tests(tmp_path, ties) -> None:
    (said,) = verify_with_r([written(of_pairs(tmp_path, ties), tmp_path)])
    assert "Every number agrees with R." in said
    robust = ("robust se", "difference robust se", "difference robust p", "robust p Holm")
    tests = ("difference p Holm", "equal abilities", "advantage of a side", "factor chi2")
    for table in ("ability", *robust, *tests):
        assert re.search(rf"^{table} .*agree$", said, re.MULTILINE), said


@needs_r
def test_r_agrees_with_thresholds_and_their_differences(tmp_path) -> None:
    (said,) = verify_with_r([written(of_thresholds(tmp_path), tmp_path)])
    assert "Every number agrees with R." in said
    for table in ("threshold", "spread", "difference", "p Holm"):
        assert re.search(rf"^{table} .*agree$", said, re.MULTILINE), said


@needs_r
@pytest.mark.parametrize(("made", "table"), [(of_pairs, "ability"), (of_thresholds, "threshold")])
def test_r_finds_a_changed_number(tmp_path, made, table) -> None:
    script = written(made(tmp_path), tmp_path)
    text = script.read_text(encoding="utf-8")
    line = re.findall(rf"^{table},[^,]*,[^\n]*$", text, re.MULTILINE)[1]
    *key, value = line.split(",")
    script.write_text(text.replace(line, ",".join([*key, repr(float(value) + 0.01)])), encoding="utf-8")
    with pytest.raises(InputError, match=rf"{table} .*DIFFER"):
        list(verify_with_r([script]))


def test_no_name_of_a_person_or_cell_is_in_code(tmp_path) -> None:
    for contents in (of_pairs(tmp_path), of_thresholds(tmp_path)):
        text = written(contents, tmp_path).read_text(encoding="utf-8")
        code = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
        assert "photorealistic" not in code
        assert "P0" not in code
