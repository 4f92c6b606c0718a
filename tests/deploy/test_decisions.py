"""The index of decisions lists every page, under its own title, with a date and a status."""

import re
from datetime import date

import pytest

from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "docs" / "decisions"
PAGES = sorted(FOLDER.glob("[0-9]*.md"))
ROW = re.compile(
    r"\| \[(?P<number>\d{4})\]\((?P<file>[^)]+)\) \| (?P<title>.+) \| (?P<date>\S+) \| (?P<status>.+) \|"
)
INDEX = [
    match
    for line in (FOLDER / "README.md").read_text(encoding="utf-8").splitlines()
    if (match := ROW.match(line))
]


def test_the_index_has_a_row_a_page_in_the_order_of_their_numbers() -> None:
    assert [row["file"] for row in INDEX] == [page.name for page in PAGES], (
        "add the new decision's row to docs/decisions/README.md"
    )
    numbers = [row["number"] for row in INDEX]
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize("row", INDEX, ids=lambda row: row["number"])
def test_a_row_says_what_its_page_says(row: re.Match[str]) -> None:
    heading = (FOLDER / row["file"]).read_text(encoding="utf-8").splitlines()[0]
    assert heading == f"# {row['number']} {row['title']}"
    assert row["file"].startswith(row["number"])
    assert date.fromisoformat(row["date"])
    replaced = re.fullmatch(r"replaced by (\d{4})", row["status"])
    assert row["status"] == "accepted" or (replaced and replaced[1] in {one["number"] for one in INDEX})
