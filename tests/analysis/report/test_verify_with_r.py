"""Scripts of a report: the quick ones first, each reported as it ends, none cut off."""

from pathlib import Path

import pytest

from analysis.report.r_models import verify_with_r
from experiments.errors import InputError
from tests.analysis.report.r_process import needed


def written(folder: Path, name: str, line: str) -> Path:
    path = folder / name
    path.write_text(line, encoding="utf-8")
    return path


def test_scripts_of_models_come_last_and_each_is_reported_before_the_next_begins(tmp_path) -> None:
    needed()
    models = [
        written(tmp_path, f"{kind}-verify.R", f'cat("{kind}"); invisible(file.create("{kind}"))\n')
        for kind in ("mixed", "ordinal")
    ]
    quick = written(tmp_path, "verify.R", 'cat("quick")\n')
    begun: list[str] = []
    told = verify_with_r([*models, quick, tmp_path / "report.html"], begun.append)
    assert next(told) == "quick"
    assert begun == []
    assert next(told).startswith("mixed")
    assert begun == ["mixed-verify.R"]
    assert not (tmp_path / "ordinal").exists()
    assert [said.strip() for said in told] == ["ordinal"]
    assert begun == ["mixed-verify.R", "ordinal-verify.R"]


def test_a_report_without_scripts_says_so(tmp_path) -> None:
    with pytest.raises(InputError, match="no R script yet"):
        next(verify_with_r([tmp_path / "report.html"]))
