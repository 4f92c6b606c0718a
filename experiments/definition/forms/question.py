"""What every type of field has."""

import random
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from experiments.base import Declaration, Name, Translated
from experiments.columns.column import Column


class Question(Declaration):
    """What every type of field has."""

    name: Name
    """Key of the answer in the runs CSV's `forms`; [[screening]] names it as `field`."""
    label: Translated
    """The question, in every language."""
    help: Translated | None = None
    """Smaller text under the question."""
    required: bool = False
    """Whether the form can be sent only once this is answered."""

    screened_by: ClassVar[Literal["limits", "options"] | None] = None
    """By what a [[screening]] rule may refuse an answer: `below` and `above`, `refused`, or not at all."""
    example: ClassVar[str] = ""
    """A field of this type as TOML, for the reference; empty where docs/reference/every-key.toml has one."""

    def problem(self, value: object) -> str | None:
        """What is wrong with an answer, expected and got; None where nothing is."""
        if is_empty(value):
            return "an answer is required" if self.required else None
        return self._problem(value)

    @property
    def values(self) -> tuple[str, ...]:
        """The answers there are, for fields of options."""
        return ()

    @abstractmethod
    def _problem(self, value: object) -> str | None:
        """As `problem`, of an answer that is not empty."""

    @abstractmethod
    def simulated(self, rng: random.Random, /) -> Any:
        """An answer that a simulated person gives."""

    @abstractmethod
    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The columns of its answers: one, for None, or one an option where several may be chosen.

        Parameters
        ----------
        name : str
            Of the column, and how those of options begin.
        asked : str
            The question in `language`.
        """


def is_empty(value: object) -> bool:
    """True where a question was left open."""
    return value is None or value in ("", [])
