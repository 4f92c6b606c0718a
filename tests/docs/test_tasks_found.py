"""Tasks of a lab in its own words: the site's search has the page, and an index of the site links it.

Sphinx lists the pages that have every word of a query, in the text or among the keywords of the head.
"""

import re

import pytest

from tests.conftest import REPOSITORY

DOCS = REPOSITORY / "docs"
TASKS = {
    "prolific completion code": "how-to/recruit",
    "consent form": "how-to/privacy-template",
    "itemized consent checkboxes": "how-to/ask-questions",
    "two alternative forced choice": "reference/trials/paired_comparison",
    "staircase threshold": "reference/trials/threshold",
    "ACR hidden reference": "how-to/mean-opinion-scores",
    "mean opinion score study": "how-to/mean-opinion-scores",
    "counterbalance block order": "how-to/order-and-counterbalance",
    "latin square": "how-to/order-and-counterbalance",
    "random assignment": "how-to/choose-a-design",
    "between subjects": "how-to/choose-a-design",
    "exclude too fast participants": "how-to/exclude-participants",
    "attention check": "how-to/check-participants",
    "sample size": "how-to/plan-the-sample",
    "preregister analysis plan": "how-to/share-a-study",
    "BIDS": "how-to/export-data",
    "import data into R": "how-to/use-r-python-spss",
    "add language french": "how-to/translate",
    "public https server": "how-to/deploy",
    "restore backup new computer": "how-to/back-up-and-restore",
    "upgrade version": "how-to/update",
    "second coder": "how-to/label-frames",
    "add student assistant": "how-to/accounts",
    "gaze performance": "how-to/animate-blinks",
    "bake own face": "how-to/own-character",
    "eyelid curve from video": "how-to/track-a-video",
    "eye aspect ratio": "how-to/measure-blinks",
    "api token": "how-to/use-the-api",
    "delete participant data": "how-to/erase-a-person",
    "cite palpebra": "how-to/share-a-study",
}
IGNORED = {"from", "into", "too"}
"""Words that the search leaves out, or that it finds everywhere."""


@pytest.mark.parametrize(("query", "page"), TASKS.items(), ids=TASKS)
def test_the_page_has_every_word_of_the_task(query: str, page: str) -> None:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8").lower()
    words = {word.rstrip("s") for word in re.findall(r"[\w-]+", query.lower())} - IGNORED
    assert [word for word in sorted(words) if not re.search(rf"\b{re.escape(word)}", text)] == []


@pytest.mark.parametrize("page", sorted({*TASKS.values()}))
def test_the_index_of_its_section_links_the_page(page: str) -> None:
    section, _, name = page.partition("/")
    index = (DOCS / section / "index.md").read_text(encoding="utf-8")
    assert re.search(rf"\]\({re.escape(name)}\.md[)#]", index)
