"""Answers to choose from."""

from collections.abc import Sequence
from typing import Any

from experiments.base import Declaration, Translated


class Option(Declaration):
    """One answer of a choice field; `value` is what is stored."""

    value: str
    """What is stored and exported, whatever language was read."""
    label: Translated
    """What the participant reads."""


def among(values: list[Any], options: Sequence[Option]) -> str | None:
    """What is wrong with `values` as answers out of `options`; None where nothing is."""
    allowed = [option.value for option in options]
    wrong = [value for value in values if value not in allowed]
    return f"expected one of {', '.join(allowed)}, got {wrong[0]!r}" if wrong else None
