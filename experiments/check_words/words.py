"""What the words of motion checks are in each language."""

from dataclasses import dataclass

DIGITS = tuple(str(digit) for digit in range(1, 10))
"""Choices of checks that show a digit: as the clip writes it, in every language."""


@dataclass(frozen=True)
class Asked:
    """The wording of one kind of check: the question, and the choices in the order of their answers."""

    question: str
    choices: tuple[str, ...]


@dataclass(frozen=True)
class CheckWords:
    """The words of every kind of check in one language; a kind that is left out does not run."""

    digit: Asked
    direction: Asked
    shape: Asked
    first_blink: Asked
    first_eye: Asked
