"""The factorial set: factors, their levels, and how many clips a cell has."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.base import Declaration, LevelName, Name
from experiments.definition.names import refuse_repeats
from experiments.rendering import RenderOverrides


class Level(Declaration):
    """One level of a factor: its name in the data, its label in tables, and what it changes in clips."""

    name: LevelName
    """Value in the factor's column of every export and part of the cell's name. Participants never see it."""
    label: str
    """What tables and figures call the level. Participants never see it."""
    render: RenderOverrides = RenderOverrides()
    """What clips of this level change of [render]. Levels that change nothing give the same clips."""


class Factor(Declaration):
    """A factor of the design. The clips are every combination of the factors' levels."""

    name: Name
    """Name of the factor's column in the ratings CSV and in the analysis; no other column may have it."""
    label: str
    """What tables, figures and reports call the factor."""
    between: bool = False
    """True shows each participant one level: groups take turns, and the analysis compares participants."""
    levels: Annotated[tuple[Level, ...], Field(min_length=1)]
    """In the order of tables and contrasts. In the list of cells the last factor's change fastest."""

    @model_validator(mode="after")
    def _levels_differ(self) -> Self:
        refuse_repeats([level.name for level in self.levels], f"level of factor '{self.name}'")
        return self


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
