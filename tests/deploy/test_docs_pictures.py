"""Pages link pictures that are there, and every picture of docs is linked: each stays in a clone for ever."""

import re

from tests.conftest import REPOSITORY

IMAGES = REPOSITORY / "docs" / "images"
LINK = re.compile(r"\]\((?P<target>[^)\s]*images/[^)\s]+)\)")


def linked() -> set[str]:
    """Names of the pictures that pages link."""
    pages = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
    return {
        match["target"].rpartition("/")[2]
        for page in pages
        for match in LINK.finditer(page.read_text(encoding="utf-8"))
    }


def test_pages_link_every_picture_and_none_that_is_missing() -> None:
    assert linked() == {picture.name for picture in IMAGES.iterdir()}
