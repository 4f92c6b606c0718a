"""The index of decisions lists every page, under its own title, with a date and a status."""

import re
from datetime import date

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


def test_each_row_says_what_its_page_says() -> None:
    numbers = {row["number"] for row in INDEX}
    for row in INDEX:
        heading = (FOLDER / row["file"]).read_text(encoding="utf-8").splitlines()[0]
        assert heading == f"# {row['number']} {row['title']}"
        assert row["file"].startswith(row["number"])
        assert date.fromisoformat(row["date"]), row["number"]
        replaced = re.fullmatch(r"replaced by (\d{4})", row["status"])
        assert row["status"] == "accepted" or (replaced and replaced[1] in numbers), row["number"]
