"""Motion checks: short clips whose answer is visible through motion only, and their questions."""

from dataclasses import dataclass
from typing import Literal

from experiments.check_words import WORDS
from experiments.check_words.words import Asked
from experiments.declaration.base import Translated

CheckName = Literal["digit", "direction", "shape", "first_blink", "first_eye"]
CHECK_CELL = ""
"""The cell of a check's clip where clips are stored by cell: no design has a cell without a name."""


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


def _kind(name: CheckName, *, own_look: bool = False) -> CheckKind:
    said: dict[str, Asked] = {language: getattr(words, name) for language, words in WORDS.items()}
    numbers = range(len(next(iter(said.values())).choices))
    return CheckKind(
        {language: asked.question for language, asked in said.items()},
        tuple({language: asked.choices[number] for language, asked in said.items()} for number in numbers),
        own_look,
    )


CHECK_KINDS: dict[CheckName, CheckKind] = {
    "digit": _kind("digit"),
    "direction": _kind("direction"),
    "shape": _kind("shape"),
    "first_blink": _kind("first_blink", own_look=True),
    "first_eye": _kind("first_eye", own_look=True),
}
