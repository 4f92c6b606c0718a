"""A report of an older capsule: what changed on purpose is named with its reason, all else without."""

import json
from datetime import date
from pathlib import Path
from typing import Any

from analysis.capsule import INTENDED, FileComparison, compare_reports, intended_change

OLD, NEW = date(2026, 11, 27), date(2026, 12, 24)
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
