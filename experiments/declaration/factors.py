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
    """Value in the factor's column of every export and part of the cell's name. Participants never see it."""
    label: str
    """What tables and figures call the level. Participants never see it."""
    render: RenderOverrides = RenderOverrides()
    """What clips of this level change of [render]. Levels that change nothing give the same clips."""


def names_listed(value: Any) -> tuple[str, ...]:
    """The characters of a list; ValueError where it is none or one of them is no name."""
    names = tuple(value) if isinstance(value, list | tuple) else ()
    if not names or not all(isinstance(name, str) and _names_a_folder(name) for name in names):
        raise ValueError(f'character: expected a list such as ["alder@8", "birch@6"], got {as_toml(value)}')
    return names


def _names_a_folder(character: str) -> bool:
    # of "." and ".." the last part is no name, and the folder is another one on every machine
    return PurePath(character).name not in ("", "..")


def level_of_character(character: str) -> dict[str, Any]:
    """The level that shows a character, named after it: the last part of a path, without a version."""
    name = _VERSION.sub("", PurePath(character).name)
    label = name.replace("_", " ").replace("-", " ")
    return {"name": name, "label": label[:1].upper() + label[1:], "render": {"character": character}}


class Factor(Declaration):
    """A factor of the design. The clips are every combination of the factors' levels."""

    name: Name
    """Name of the factor's column in the ratings CSV and in the analysis; no other column may have it."""
    label: str
    """What tables, figures and reports call the factor."""
    between: bool = False
    """On: each participant sees one level, groups take turns, and the analysis compares participants. Off:
    everybody sees every level."""
    random: bool = False
    """On: the levels stand for more like them, such as faces or voices: the analysis of variance averages
    over them, and the mixed models have them as random items, so that results hold for others. Off: the
    levels are compared with one another."""
    per_participant: Annotated[int, Field(ge=1, le=1000)] | None = None
    """How many of a random factor's levels a participant sees, each level equally often over participants,
    give or take one; left out, all of them."""
    character: tuple[str, ...] = ()
    """Characters (names, or paths of folders) that each make a level, named after it without its version;
    written instead of `levels`, and read as these: a declaration that was read has the levels and no list."""
    levels: Annotated[tuple[Level, ...], Field(min_length=1)]
    """In the order of tables and contrasts. In the list of cells the last factor's change fastest."""

    @model_validator(mode="before")
    @classmethod
    def _levels_of_characters(cls, data: Any) -> Any:
        listed = data.get("character") if isinstance(data, Mapping) else None
        if listed is None or (not listed and data.get("levels")):
            return data
        if data.get("levels"):
            raise ValueError("a level for each `character`, or `levels` of its own: leave one of them out")
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
                "a factor is `random` or `between`, not both: give `per_participant = 1` to show each "
                "participant one of its levels"
            )
        if self.per_participant is None:
            return self
        if not self.random:
            raise ValueError("per_participant is for random factors: set `random = true`, or leave it out")
        if self.per_participant > len(self.levels):
            raise ValueError(
                f"per_participant: expected at most the {len(self.levels)} levels, got {self.per_participant}"
            )
        return self

    @property
    def dealt(self) -> bool:
        """Whether participants see some of its levels only."""
        return self.per_participant is not None and self.per_participant < len(self.levels)


class Exemplars(Declaration):
    """How many clips a cell has, and which factors bring exemplars of their own.

    Exemplar 3 of two cells shows the same blink unless the cells differ in a factor named in `own_per`.
    """

    per_cell: Annotated[int, Field(ge=1, le=1000)]
    """Clips (different blinks) in each cell. More of them make means less dependent on single blinks."""
    own_per: tuple[Name, ...] = ()
    """Factors whose levels show different blinks; over all other factors exemplar n is the same blink."""
    seed: int = 2011
    """Seed of the draw of recorded blinks. Another seed gives other clips, and with them another study."""
