"""Motion checks: short clips whose answer is visible through motion only, and their questions.

The words of each page language are in `check_words/TAG.toml`, found by their names. Only English is reviewed;
every other file says at its top that it awaits review. `frontend/src/i18n/reviewed.ts` names the readers.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from experiments.declaration.base import Translated

CheckName = Literal["digit", "direction", "shape", "first_blink", "first_eye"]
CHECK_CELL = ""
"""The cell of a check's clip where clips are stored by cell: no design has a cell without a name."""
DIGITS = [str(digit) for digit in range(1, 10)]
"""Choices of checks that show a digit: as the clip writes it, in every language."""
FOLDER = Path(__file__).parent / "check_words"


@dataclass(frozen=True)
class CheckWords:
    """The wording of one kind of check: the question, and the choices in the order of their answers."""

    question: str
    choices: tuple[str, ...]


@dataclass(frozen=True)
class CheckKind:
    """The question about the clips of one kind of check.

    Attributes
    ----------
    question, choices : Translated, tuple of Translated
        By language; answers are numbered from 1 in the order of the choices.
    own_look : bool
        True where the clip shows the study's own character, else it shows random dots.
    """

    question: Translated
    choices: tuple[Translated, ...]
    own_look: bool = False


def _words_of(file: Path) -> dict[str, CheckWords]:
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    return {
        name: CheckWords(table["question"], tuple(table.get("choices", DIGITS)))
        for name, table in tables.items()
    }


WORDS: dict[str, dict[str, CheckWords]] = {
    file.stem: _words_of(file) for file in sorted(FOLDER.glob("*.toml"))
}
"""Words of every language, by its tag and by the name of the check."""


def _kind(name: CheckName, *, own_look: bool = False) -> CheckKind:
    # A language may lack a kind while it is being translated; the page then asks in English.
    by_language = {language: words.get(name, WORDS["en"][name]) for language, words in WORDS.items()}
    return CheckKind(
        {language: words.question for language, words in by_language.items()},
        tuple(
            {language: words.choices[number] for language, words in by_language.items()}
            for number in range(len(WORDS["en"][name].choices))
        ),
        own_look,
    )


CHECK_KINDS: dict[CheckName, CheckKind] = {
    "digit": _kind("digit"),
    "direction": _kind("direction"),
    "shape": _kind("shape"),
    "first_blink": _kind("first_blink", own_look=True),
    "first_eye": _kind("first_eye", own_look=True),
}
