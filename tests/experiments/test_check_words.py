"""Every language of the page has the words of motion checks, whole and in the order of the answers."""

from pathlib import Path

import pytest

from experiments.checks import CHECK_KINDS, DIGITS, WORDS

LANGUAGES = Path(__file__).parents[2] / "frontend/src/i18n/languages"
CHOICES = {"digit": 9, "direction": 4, "shape": 4, "first_blink": 2, "first_eye": 2}


def test_every_language_of_the_page_has_them() -> None:
    assert sorted(WORDS) == sorted(path.stem for path in LANGUAGES.glob("*.json"))


@pytest.mark.parametrize("language", sorted(WORDS))
def test_no_word_is_missing_doubled_or_left_in_english(language: str) -> None:
    for name, number in CHOICES.items():
        asked = WORDS[language][name]
        assert len(asked.choices) == number, name
        assert all(word.strip() for word in (asked.question, *asked.choices)), name
        assert len(set(asked.choices)) == number, name
        if language != "en":
            assert asked.question != WORDS["en"][name].question, name
    assert WORDS[language]["digit"].choices == tuple(DIGITS)


@pytest.mark.parametrize("language", sorted(set(WORDS) - {"en"}))
def test_what_nobody_has_read_says_so(language: str) -> None:
    text = Path(__file__).parents[2] / f"experiments/check_words/{language}.toml"
    assert "Unreviewed" in text.read_text(encoding="utf-8").partition("[")[0]


def test_the_page_gets_the_choices_in_the_order_of_their_answers() -> None:
    assert {name: len(kind.choices) for name, kind in CHECK_KINDS.items()} == CHOICES
    assert CHECK_KINDS["direction"].choices[2]["fr"] == WORDS["fr"]["direction"].choices[2] == "vers le haut"
    assert CHECK_KINDS["first_eye"].own_look
    assert not CHECK_KINDS["shape"].own_look
