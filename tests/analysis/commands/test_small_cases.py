"""Small files with known answers (../shared/cases/statistics), through the command line."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from analysis.cli import app

CASES = Path(__file__).parents[4] / "shared/cases/statistics"
pytestmark = pytest.mark.skipif(not CASES.exists(), reason="../shared/cases/statistics is not here")


def run(command: str, name: str, options: str, out: Path | None = None) -> tuple[str, dict[str, Any]]:
    arguments = [command, str(CASES / name), *options.split(), *(["--json", str(out)] if out else [])]
    done = CliRunner().invoke(app, arguments)
    said = " ".join(f"{done.output} {done.exception or ''}".split())
    return said, json.loads(out.read_text(encoding="utf-8")) if out and out.exists() else {}


def test_a_slope_within_participants(tmp_path: Path) -> None:
    options = "--participant Subject --rating Reaction --covariate Days"
    _, data = run("mixed", "c30_sleepstudy.csv", options, tmp_path / "o.json")
    (days,) = data["effects"]
    assert (days["f_value"], days["df_error"]) == pytest.approx((45.853, 17), abs=1e-3)


@pytest.mark.parametrize(("name", "within"), [("c07_level_names", "prompt,type"), ("c07b_clock", "a,b")])
def test_cells_with_colons_in_their_levels(name: str, within: str, tmp_path: Path) -> None:
    options = f"--participant id --rating y --within {within} --two-factor-pairs"
    _, data = run("anova", f"{name}.csv", options, tmp_path / "o.json")
    pairs = data["pairwise"]
    assert len({(p["effect"], p["level_a"], p["level_b"]) for p in pairs}) == len(pairs)
    cells = {json.dumps([p["cell_a"], p["cell_b"]]) for p in pairs}
    assert len(cells) == len(pairs)
    assert all(p["cell_a"].keys() == set(p["effect"].split(":")) for p in pairs)


def test_a_file_pasted_twice(tmp_path: Path) -> None:
    options = "--participant id --rating y --within cond --item clip"
    once, data = run("mixed", "c27m_once.csv", f"{options} --slopes none", tmp_path / "o.json")
    assert data["effects"][0]["f_value"] == pytest.approx(12.98, abs=0.005)
    assert "pasted twice" not in once
    _, data = run("ordinal", "c27m_once.csv", options, tmp_path / "p.json")
    assert data["effects"][0]["chi2"] == pytest.approx(12.43, abs=0.005)
    for command in ("mixed", "ordinal"):
        twice, _ = run(command, "c27m_twice.csv", options)
        assert "lines 226 to 449 are exact copies of lines 2 to 225" in twice


def test_distinct_stimuli(tmp_path: Path) -> None:
    said, data = run(
        "thresholds", "c14b_distinct_guess0.csv", "--x x --response response", tmp_path / "o.json"
    )
    fit = data["pooled"]["all"]
    assert "no upper limit" not in said
    assert fit["spread_ci"]["low"] < fit["spread"] < fit["spread_ci"]["high"]
    assert fit["p"] is None


def test_ids_that_occur_once() -> None:
    said, _ = run("anova", "c08_id_not_repeated.csv", "--participant id --rating y --within time")
    assert "Is the table wide" in said
    assert "is this not the participant column" in said
    wide, _ = run("anova", "c26_wide.csv", "--participant subject --rating near_NB --within near_MB")
    assert "--columns '{factor1}_{factor2}'" in wide


def test_a_covariate_of_people_in_an_anova(tmp_path: Path) -> None:
    """Afex, centered."""
    options = "--participant Subject --rating RT --within Cong --between Alcohol --covariate age"
    _, data = run("anova", "c11_ancova.csv", options, tmp_path / "o.json")
    found = {effect["effect"]: effect["univariate"]["f_value"] for effect in data["effects"]}
    assert found["Cong"] == pytest.approx(20.93631536, rel=1e-6)
    assert found["age:Cong"] == pytest.approx(3.60463464, rel=1e-6)


def test_marks_with_two_readings_are_refused_with_both() -> None:
    said, _ = run("anova", "c05c_mixed_marks.csv", "--participant id --rating rt --within cond")
    assert "can be read as 1.036 or as 1036" in said
