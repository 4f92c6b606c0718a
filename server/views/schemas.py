"""Views as the page sends them: when they begin, and once more when they have ended."""

from datetime import UTC, datetime
from typing import Annotated, Any
from uuid import UUID

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, StringConstraints

from server.trials.schemas import Count, FrameTime, Role

# The earliest and latest moments of the calendar have no UTC in it.
Moment = Annotated[
    AwareDatetime, Field(ge=datetime(1970, 1, 1, tzinfo=UTC), lt=datetime(9000, 1, 1, tzinfo=UTC))
]


class SeenClip(BaseModel):
    """One clip of a view with its drawn frames."""

    model_config = ConfigDict(extra="forbid")
    role: Role
    clip_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
    drawn: Annotated[list[FrameTime], Field(max_length=5000)] = Field(
        description="Index and time in ms since the view's start of every drawn frame."
    )


class ViewIn(BaseModel):
    """One view; sent without an end when it begins, with one when it has ended."""

    model_config = ConfigDict(extra="forbid")
    id: UUID
    trial_index: Count
    number: Annotated[int, Field(ge=1, le=1000)] = Field(description="Of the trial's views, from 1.")
    started_at_client: Moment
    ended_at_client: Moment | None = None
    screen: dict[Annotated[str, StringConstraints(max_length=100)], Any] = Field(
        default_factory=dict, max_length=50
    )
    clips: Annotated[list[SeenClip], Field(max_length=6)] = []


class ViewsIn(BaseModel):
    """Up to 100 views; what the server already has is left as it is."""

    model_config = ConfigDict(extra="forbid")
    views: list[ViewIn] = Field(max_length=100)


class ViewsSaved(BaseModel):
    """How many were new, how many were completed."""

    begun: int
    completed: int
    saved_at: datetime
