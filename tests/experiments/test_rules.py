"""Warnings speak every language of the page. That each rule is applied, `make check` sees (assert_never)."""

from experiments.rules.warnings import WarnFast, WarnPattern, WarnSameAnswer
from tests.conftest import REPOSITORY


def test_warnings_have_words_in_every_language_of_the_page() -> None:
    pages = REPOSITORY / "frontend" / "src" / "i18n" / "languages"
    languages = {path.stem for path in pages.glob("*.json")}
    assert len(languages) >= 11
    for rule in (WarnFast, WarnPattern, WarnSameAnswer):
        words = rule().text
        assert set(words) == languages
        assert len({text.split("\n", 1)[1] for text in words.values()}) == len(languages)
        assert all(text.startswith("# ") for text in words.values())
