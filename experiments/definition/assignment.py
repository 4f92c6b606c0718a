"""Who sees which of the clips."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from experiments.base import Declaration


class Assignment(Declaration):
    """Which clips of their cells participants see; without a key everybody sees every clip.

    Places are dealt in turn: one that is given up, or screened out, goes to the next participant.
    """

    clips_per_cell: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Clips of each cell that a participant sees, with the same exemplar numbers in all cells, so that cells
    are compared over the same blinks. Over participants each clip is seen equally often, give or take one."""
    lists: tuple[Annotated[tuple[str, ...], Field(min_length=1)], ...] = ()
    """Lists of clips, dealt to participants in turn. A clip is written as cell and exemplar: `"SL/30/1"`."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.clips_per_cell is not None and self.lists:
            raise ValueError("give `clips_per_cell` or `lists`, not both")
        for number, clips in enumerate(self.lists, start=1):
            repeated = sorted({clip for clip in clips if clips.count(clip) > 1})
            if repeated:
                raise ValueError(f"list {number}: '{repeated[0]}' stands twice in it")
        return self
