"""The factorial set: factors, their levels, and how many clips a cell has."""

import re
from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from experiments.declaration.base import Declaration, LevelName, Name, refuse_repeats
from experiments.declaration.rendering import RenderOverrides
from experiments.errors import as_toml

_VERSION = re.compile(r"(?<=.)@\d+$")


class Level(Declaration):
    """One level of a factor: its name in the data, its label in tables, and what it changes in clips."""

    name: LevelName
    """Value in the factor's column of every export, and part of the cell name. Participants never see it."""
    label: str
    """Label of the level in tables and figures. Participants never see it."""
    render: RenderOverrides = RenderOverrides()
    """Settings of [render] that this level changes. Levels that change nothing share the same clips."""


def names_listed(value: Any) -> tuple[str, ...]:
    """The characters of a list; ValueError if it is not a list of names."""
    names = tuple(value) if isinstance(value, list | tuple) else ()
    if not names or not all(isinstance(name, str) and _names_a_folder(name) for name in names):
        raise ValueError(f'character: expected a list such as ["alder@8", "birch@6"], got {as_toml(value)}')
    return names


def _names_a_folder(character: str) -> bool:
    # the last part of "." and ".." is not a name, and the folder differs between machines
    return PurePath(character).name not in ("", "..")


def level_of_character(character: str) -> dict[str, Any]:
    """The level that shows a character, named after it: the last part of a path, without a version."""
    name = _VERSION.sub("", PurePath(character).name)
    label = name.replace("_", " ").replace("-", " ")
    return {"name": name, "label": label[:1].upper() + label[1:], "render": {"character": character}}


class Factor(Declaration):
    """A factor of the design. The clips are every combination of the factors' levels."""

    name: Name
    """Name of the factor's column in the ratings CSV and in the analysis. No other column may have this
    name."""
    label: str
    """Label of the factor in tables, figures and reports."""
    between: bool = False
    """On: each participant sees one level, groups take turns, and the analysis compares participants. Off:
    everyone sees every level."""
    random: bool = False
    """On: the levels are a sample of many, such as faces or voices. The analysis of variance averages over
    them, and mixed models treat them as random items, so that results generalize. Off: the levels are
    compared with one another."""
    per_participant: Annotated[int, Field(ge=1, le=1000)] | None = None
    """How many levels of a random factor each participant sees. Levels are balanced over participants to
    within one. Leave empty to show all."""
    character: tuple[str, ...] = ()
    """Characters (names or folder paths), one level each. Each level is named after its character, without
    the version. Use this instead of `levels`; the parsed declaration contains the levels only."""
    levels: Annotated[tuple[Level, ...], Field(min_length=1)]
    """The levels, in the order of tables and contrasts. In the list of cells, the last factor varies
    fastest."""

    @model_validator(mode="before")
    @classmethod
    def _levels_of_characters(cls, data: Any) -> Any:
        listed = data.get("character") if isinstance(data, Mapping) else None
        if listed is None or (not listed and data.get("levels")):
            return data
        if data.get("levels"):
            raise ValueError("expected `character` or `levels`, got both; remove one of them")
        levels = tuple(level_of_character(name) for name in names_listed(listed))
        return {**data, "character": (), "levels": levels}

    @model_validator(mode="after")
    def _levels_differ(self) -> Self:
        refuse_repeats([level.name for level in self.levels], f"level of factor '{self.name}'")
        return self

    @model_validator(mode="after")
    def _random_fits(self) -> Self:
        if self.random and self.between:
            raise ValueError(
                "expected `random` or `between`, got both; use `random` with `per_participant = 1` to show "
                "each participant one level"
            )
        if self.per_participant is None:
            return self
        if not self.random:
            raise ValueError(
                "per_participant applies to random factors only; set `random = true` or remove it"
            )
        if self.per_participant > len(self.levels):
            raise ValueError(
                f"per_participant: expected at most the {len(self.levels)} levels, got {self.per_participant}"
            )
        return self

    @property
    def dealt(self) -> bool:
        """Whether each participant sees only some of its levels."""
        return self.per_participant is not None and self.per_participant < len(self.levels)


class Exemplars(Declaration):
    """How many clips a cell has, and which factors have different blinks at each level.

    Exemplar 3 of two cells shows the same blink unless the cells differ in a factor listed in `own_per`.
    """

    per_cell: Annotated[int, Field(ge=1, le=1000)]
    """Clips (different blinks) in each cell. With more clips, means depend less on single blinks."""
    own_per: tuple[Name, ...] = ()
    """Factors whose levels show different blinks. For all other factors, exemplar n is the same blink at
    every level."""
    seed: int = 2011
    """Random seed for the choice of recorded blinks. A different seed gives different clips and therefore a
    different study."""
