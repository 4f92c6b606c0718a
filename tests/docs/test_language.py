"""`make check-docs` finds words to avoid, British spellings, hard pages and broken links."""

from pathlib import Path

import pytest

from tools.check_language import (
    BANNED_WORDS,
    BRITISH_WORDS,
    banned_words_in,
    broken_links,
    faults_of_grades,
    long_sentences_in,
)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("It is read anew.", "anew"),
        ("The file stands beside it.", "beside"),
        ("The value is no number.", "is no"),
        ("A table with a column an eye.", "a column an eye"),
        ("JSON, one object a line.", "one object a line"),
        ("The median, a value an eye; quartiles follow.", "a value an eye"),
        ("Two declared rows a participant, in files.", "Two declared rows a participant"),
        ("Attention checks, one a block.", "one a block"),
        ("Speed is 0.1 px a frame.", "px a frame"),
        ("The colour of the iris.", "colour"),
        ("Labelled frames are analysed.", "Labelled"),
        ("Runs are randomised.", "randomised"),
        ("Two grey fields.", "grey"),
    ],
)
def test_a_word_to_avoid_is_found(text: str, word: str) -> None:
    assert word in [seen for _, seen, _ in banned_words_in(text, BANNED_WORDS + BRITISH_WORDS)]


@pytest.mark.parametrize(
    "text",
    [
        "There is no default, and there are no exceptions.",
        "It stands for a level; stand-ins are used.",
        'The key `colour` and the text "labelled" are code and a quotation.',
        "Exercise, otherwise, precise, analyses and irises are American too.",
        "[g-lang]: https://example.org/localisation",
        "The line a person sees, and one value a level has.",
        "How many clips a cell has; two clips a participant saw.",
        "Call one a factor, or a file a folder of its kind.",
        "At most two answers a minute, three times a day.",
    ],
)
def test_plain_american_english_passes(text: str) -> None:
    assert list(banned_words_in(text, BANNED_WORDS + BRITISH_WORDS)) == []


def test_a_page_that_is_hard_to_read_is_named() -> None:
    assert faults_of_grades([(15.2, "docs/hard.md"), (6.0, "docs/easy.md"), (5.0, "docs/easier.md")]) == [
        "docs/hard.md: reading grade 15.2, at most 14: write shorter sentences"
    ]
    assert faults_of_grades([(12.0, "docs/a.md"), (11.0, "docs/b.md")]) == [
        "reading grade of the pages: median 11.5, at most 10"
    ]


def test_a_link_to_a_missing_file_or_heading_is_found(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text(
        "# Other\n\n## What you get\n\n## `analysis pairs`\n", encoding="utf-8"
    )
    page = tmp_path / "page.md"
    page.write_text(
        "[a](other.md) [b](other.md#what-you-get) [c](other.md#analysis-pairs) [d](https://example.org)\n"
        "[e](missing.md) [f](other.md#what-you-pay) [g](#nowhere)\n",
        encoding="utf-8",
    )
    assert [fault.split()[3] for fault in broken_links(page)] == [
        "missing.md",
        "other.md#what-you-pay",
        "#nowhere",
    ]


def test_a_long_sentence_of_an_error_is_found_whatever_it_is_made_of() -> None:
    words = " ".join(["word"] * 24)
    long = f"raise InputError(f'{{file}}: {words} ' + 'end. Short.')"
    assert [line for line, _ in long_sentences_in(long)] == [1]
    assert list(long_sentences_in(long.replace("word word", "word. Word", 1))) == []
