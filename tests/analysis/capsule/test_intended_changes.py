"""A report of an older capsule: what changed on purpose is named with its reason, all else without."""

import json
from datetime import date
from pathlib import Path
from typing import Any

from analysis.capsule import (
    INTENDED,
    RENAMED,
    REWORDED,
    FileComparison,
    compare_reports,
    intended_change,
    is_reworded,
)

OLD, NEW = date(2026, 11, 27), date(2026, 12, 24)
BETWEEN = date(2026, 11, 30)
WAS = {
    "effects": [{"f": 5.25}],
    "pairwise": [{"p": 0.01}, {"p": 0.02}],
    "evidence": {"verdicts": {"likely": 3}},
}
REPORT = "# Title\n\n## Results\n\nF = 5.25\n\n## Ordinal mixed model\n\nchi2 = 18.42\n"


def compared(tmp_path: Path, name: str, was: str, now: str, made: date) -> FileComparison:
    for folder, content in (("before", was), ("after", now)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text(content)
    (one,) = compare_reports((name,), tmp_path / "before", tmp_path / "after", made)
    return one


def of_results(tmp_path: Path, changes: dict[str, Any], made: date) -> FileComparison:
    return compared(tmp_path, "results.json", json.dumps(WAS), json.dumps(WAS | changes), made)


def test_numbers_that_changed_on_purpose_are_named_with_the_reason(tmp_path: Path) -> None:
    named = [{"p": 0.01, "cell_a": {"a": "x"}}, {"p": 0.02, "cell_a": {"a": "y"}}]
    one = of_results(tmp_path, {"pairwise": named, "evidence": {"verdicts": {"likely": 1}}}, OLD)
    assert one.kind == "table"
    assert (
        "pairwise[0].cell_a: 'None' became \"{'a': 'x'}\" and 1 more, changed on purpose on 2026-11-28"
        in one.said
    )
    assert "evidence.verdicts.likely: '3' became '1', changed on purpose" in one.said
    assert one.said.endswith("(CHANGELOG.md, Numbers changed)")


def test_any_other_number_comes_first_and_without_an_excuse(tmp_path: Path) -> None:
    one = of_results(tmp_path, {"effects": [{"f": 5.5}], "evidence": {"verdicts": {"likely": 1}}}, OLD)
    assert one.said.startswith("effects[0].f: '5.25' became '5.5'; evidence")


def test_a_capsule_made_after_the_change_has_no_excuse(tmp_path: Path) -> None:
    one = of_results(tmp_path, {"evidence": {"verdicts": {"likely": 1}}}, NEW)
    assert one.said == "evidence.verdicts.likely: '3' became '1'"


def test_tables_are_explained_by_their_section(tmp_path: Path) -> None:
    one = compared(tmp_path, "report.md", REPORT, REPORT.replace("18.42", "1.99"), OLD)
    assert one.kind == "table"
    assert one.said.startswith(
        "'Ordinal mixed model', line 3: 'chi2 = 18.42' became 'chi2 = 1.99', changed on purpose"
    )


def test_a_table_elsewhere_is_not_excused(tmp_path: Path) -> None:
    one = compared(tmp_path, "report.md", REPORT, REPORT.replace("5.25", "5.5"), OLD)
    assert one.said == "'Results', line 3: 'F = 5.25' became 'F = 5.5'"


def test_no_change_excuses_the_main_tests() -> None:
    for change in INTENDED:
        for place in ("effects[0].f", "effects[0].p", "marginal_means[0].mean", "Results", "Every test"):
            assert intended_change(place, change.since) is None


LEFT_OUT = "## Who and what was left out\n\n- nothing; every row counts\n\n## Results\n\nF = 5.25\n"
EXCLUDED = "## Exclusions and decisions\n\n- none; every row was analyzed\n\n## Results\n\nF = 5.25\n"


def test_a_sentence_with_equal_numbers_is_named_as_new_wording(tmp_path: Path) -> None:
    one = compared(tmp_path, "report.md", LEFT_OUT, EXCLUDED, BETWEEN)
    assert one.kind == "table"
    assert one.said == (
        "'Exclusions and decisions', line 3: '- nothing; every row counts' became '- none; every row was "
        f"analyzed', changed on purpose on {REWORDED}: the wording is in plainer English; all numbers are "
        "equal"
    )


def test_a_later_capsule_has_the_new_wording(tmp_path: Path) -> None:
    one = compared(tmp_path, "report.md", LEFT_OUT, EXCLUDED, NEW)
    assert "changed on purpose" not in one.said


def test_new_wording_explains_no_number_no_table_and_no_name(tmp_path: Path) -> None:
    was = "Effects of the blur were F = 5.25 today\n| a | human face of the four |\n"
    assert is_reworded(was, was.replace("today", "now and here"))
    assert not is_reworded(was, was.replace("5.25", "5.26"))
    assert not is_reworded(was, was.replace("human face", "doll face"))
    assert not is_reworded("human", "doll")


def test_renamed_terms_count_as_wording() -> None:
    for old, new in RENAMED.items():
        assert is_reworded(f"| {old} | 3 |", f"| {new} | 3 |")


def test_new_wording_of_a_decision_in_the_numbers_is_named(tmp_path: Path) -> None:
    was, now = "3 rows without a rating left out", "3 rows without a rating excluded"
    one = compared(
        tmp_path, "results.json", json.dumps({"decisions": [was]}), json.dumps({"decisions": [now]}), BETWEEN
    )
    assert "decisions[0]" in one.said
    assert f"changed on purpose on {REWORDED}" in one.said
    assert "Numbers changed" not in one.said
