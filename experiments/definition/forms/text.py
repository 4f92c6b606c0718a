"""Free text."""

import random
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from experiments.columns.column import Column
from experiments.definition.forms.question import Question


class TextField(Question):
    """Free text."""

    type: Literal["text"] = "text"
    """Names this type of field."""
    max_length: Annotated[int, Field(ge=1, le=5000)] = 500
    """Longest answer, in characters."""

    def _problem(self, value: object) -> str | None:
        fits = isinstance(value, str) and len(value) <= self.max_length
        return None if fits else f"expected text of at most {self.max_length} characters"

    def simulated(self, _rng: random.Random, /) -> str:
        """A word that says where it comes from."""
        return "simulated"[: self.max_length]

    def columns(self, name: str, asked: str, language: str) -> Mapping[str | None, Column]:
        """The text, by which people may be known."""
        del language
        return {None: Column(name, "text", asked, identifying=True)}
