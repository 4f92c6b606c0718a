"""The index of decisions lists every record, and code and docs name only records that exist."""

import re
import subprocess
from datetime import date

import pytest

from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "docs" / "explanation" / "decisions"
RECORDS = sorted(FOLDER.glob("[0-9]*.md"))
NUMBERS = {record.name[:4] for record in RECORDS}
ROW = re.compile(r"\| \[(?P<number>\d{4})\]\((?P<file>[^)]+)\) \| (?P<title>.+) \| (?P<date>\S+) \|")
INDEX = [
    match
    for line in (FOLDER / "README.md").read_text(encoding="utf-8").splitlines()
    if (match := ROW.match(line))
]
NAMED = re.compile(r"[Dd]ecisions?[ /](\d{4})")


def test_index_lists_every_record_in_order() -> None:
    assert [row["file"] for row in INDEX] == [record.name for record in RECORDS], (
        "add the new decision's row to docs/explanation/decisions/README.md"
    )


@pytest.mark.parametrize("row", INDEX, ids=lambda row: row["number"])
def test_row_repeats_title_and_has_a_date(row: re.Match[str]) -> None:
    text = (FOLDER / row["file"]).read_text(encoding="utf-8")
    assert text.startswith(f"# {row['number']} {row['title']}\n")
    assert row["file"].startswith(row["number"])
    assert date.fromisoformat(row["date"])


def _named(*patterns: str) -> dict[str, set[str]]:
    listed = subprocess.run(
        ["git", "ls-files", *patterns], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    named: dict[str, set[str]] = {}
    for name in listed.stdout.splitlines():
        file = REPOSITORY / name
        if file.is_file() and file != REPOSITORY / "CHANGELOG.md":
            for number in NAMED.findall(file.read_text(encoding="utf-8")):
                named.setdefault(number, set()).add(name)
    return named


def test_every_decision_named_anywhere_has_a_record() -> None:
    named = _named("*.py", "*.ts", "*.tsx", "*.toml", "*.md", "*.yml", "*.conf")
    missing = {number: files for number, files in named.items() if number not in NUMBERS}
    assert not missing


def test_every_decision_is_named_in_code() -> None:
    named = _named("*.py", "*.ts", "*.tsx", "*.toml", "*.conf", "Makefile")
    assert not NUMBERS - set(named)
