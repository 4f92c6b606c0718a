"""Names of buttons, pages and fields in the documentation are those of the program.

Pages write them in *italics*, and nothing else that begins with a capital letter but the exceptions below.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tools.check_language import without_code_blocks

SOURCES = [
    *(REPOSITORY / "frontend" / "src").rglob("*.ts*"),
    *(REPOSITORY / "packages" / "blender_addon").rglob("*.py"),
    *(REPOSITORY / "experiments").rglob("*.py"),
    *(REPOSITORY / "server" / "studies").rglob("*.py"),
]
FOLDERS = ("tutorials", "how-to", "explanation", "reference/trials")
PAGES = sorted(page for folder in FOLDERS for page in (REPOSITORY / "docs" / folder).glob("*.md"))
NOT_OURS = {
    "sign-in.md": {"Developer tools"},  # of ORCID
    "paper.md": {"Modeling and Animating Eye Blinks"},
    "blink-engine.md": {"Live Link", "Apple ARKit Face Support", "Import", "Level Sequence"},  # of Unreal
}
"""Names in other programs, and titles."""
STRING = re.compile(r"\"([^\"\n]+)\"|'([^'\n]+)'|`([^`]+)`", re.DOTALL)
BETWEEN_TAGS = re.compile(r">\s*([A-Z][^<>{}]*?)\s*[<{]")
ATTRIBUTE = re.compile(r"=\"([^\"\n]+)\"")
ITALIC = re.compile(r"(?<![\w*\\])\*([A-Z][^*\n]*)\*(?![\w*])")
EMPHASIS = re.compile(r"`[^`\n]*`|\*\*[^*]+\*\*")


def texts_of(source: str) -> Iterator[str]:
    """Every string, and every attribute and text between tags by itself.

    A backtick inside a template, or an apostrophe, makes the first expression take code for a string.
    """
    yield from ATTRIBUTE.findall(source)
    yield from (" ".join(text.split()) for text in BETWEEN_TAGS.findall(source))
    for match in STRING.finditer(source):
        yield " ".join(next(part for part in match.groups() if part is not None).split())


def terms_of(page: str) -> set[str]:
    """What a page has in italics that begins with a capital letter."""
    return set(ITALIC.findall(EMPHASIS.sub(" ", without_code_blocks(page))))


@pytest.fixture(scope="module")
def ui_texts() -> set[str]:
    texts = {text.rstrip(" .:…▾") for file in SOURCES for text in texts_of(file.read_text(encoding="utf-8"))}
    assert len(texts) > 2000
    return texts


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_names_on_the_page_are_in_the_program(page: Path, ui_texts: set[str]) -> None:
    terms = terms_of(page.read_text(encoding="utf-8")) - NOT_OURS.get(page.name, set())
    missing = {term for term in terms if term.rstrip(" .:…") not in ui_texts}
    assert not missing, "write these as the program does, or without italics"


def test_a_name_that_is_not_there_is_found(ui_texts: set[str]) -> None:
    assert terms_of("Choose *Set live*, then **bold**, `*Code*` and *lower*.") == {"Set live"}
    assert "Set live" in ui_texts
    assert "Set alive" not in ui_texts


def test_most_pages_for_people_name_parts_of_the_program() -> None:
    named = [page for page in PAGES if terms_of(page.read_text(encoding="utf-8"))]
    assert len(named) > 25
