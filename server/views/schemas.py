"""Views as the page sends them: when they begin, and once more when they have ended."""

from collections import Counter
from collections.abc import Set
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self
from uuid import UUID

from pydantic import (
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    StringConstraints,
    model_validator,
)

from server.evidence.schemas import ViewEvidence
from server.trials.measures import Count, DisturbanceCounts, FrameTime, Milliseconds, Role
from server.trials.unknown_values import ANY, IMPOSSIBLE, LEFT_OUT, Path, validated

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


class ViewShowing(BaseModel):
    """What was measured of one clip of a view, or of several at once; its frames are with the clips.

    With it another page, or another device, can ask for the answer without a second view.
    """

    model_config = ConfigDict(extra="forbid")
    roles: Annotated[list[Role], Field(min_length=1, max_length=6)]
    method: Literal["webcodecs", "video"]
    frames: Count
    fps: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
    ended_ms: Milliseconds = Field(description="From the view's start key to the clip's end.")
    stalls: Count
    clock_gap_ms: Milliseconds | None
    clock_late_ms: Annotated[float, Field(ge=-1e10, le=1e10, allow_inf_nan=False)] | None
    focus_lost: Count
    visible_share: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = Field(
        default=None, description="Smallest share of the clip inside the window."
    )
    refresh_ms: Milliseconds | None = Field(
        default=None, description="Median time between refreshes during the clip."
    )


Outcome = Literal["shown", "interrupted"]


class ViewIn(BaseModel):
    """One view; sent without an end when it begins, with one when it has ended."""

    model_config = ConfigDict(extra="forbid")
    id: UUID
    trial_index: Count
    number: Annotated[int, Field(ge=1, le=1000)] = Field(description="Of the trial's views, from 1.")
    play: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="The play that it is part of; an older page has one view a play."
    )
    started_at_client: Moment | None = Field(description="Null where the device's clock cannot be right.")
    ended_at_client: Moment | None = None
    screen: dict[Annotated[str, StringConstraints(max_length=100)], Any] = Field(
        default_factory=dict, max_length=50
    )
    clips: Annotated[list[SeenClip], Field(max_length=6)] = []
    outcome: Outcome | None = Field(
        default=None, description="How it ended: shown to its end, or broken off by a reload or a crash."
    )
    showings: Annotated[list[ViewShowing], Field(max_length=6)] | None = None
    disturbances: DisturbanceCounts = {}
    evidence: ViewEvidence | None = Field(
        default=None, description="The ticket of its play; an older page has none for views."
    )


_MEASURED: dict[Path, Any] = {
    # As a whole, by its first fault: a showing of which a part is unknown is not asked about by another page.
    ("views", ANY, "showings"): None,
    ("views", ANY, "clips", ANY, "drawn"): [],
    ("views", ANY, "started_at_client"): None,
    ("views", ANY, "ended_at_client"): None,
    ("views", ANY, "screen"): LEFT_OUT,
    ("views", ANY, "disturbances", ANY): LEFT_OUT,
    ("views", ANY, "disturbances"): LEFT_OUT,
}


def _count_unknown(data: Any, unknown: Set[Path]) -> None:
    for index, number in Counter(path[1] for path in unknown).items():
        view = data["views"][int(index)]
        told = view.get("disturbances")
        view["disturbances"] = {**(told if isinstance(told, dict) else {}), IMPOSSIBLE: number}


class ViewsIn(BaseModel):
    """Up to 100 views; what the server already has is left as it is."""

    model_config = ConfigDict(extra="forbid")
    views: list[ViewIn] = Field(max_length=100)

    @model_validator(mode="wrap")
    @classmethod
    def _whatever_was_measured(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """A number that no browser can have measured is unknown, and counted; the view is stored."""
        return validated(data, handler, _MEASURED, _count_unknown)


class ViewsSaved(BaseModel):
    """How many were new, how many were completed."""

    begun: int
    completed: int
    saved_at: datetime


class ViewState(BaseModel):
    """A view of a trial that still waits for its answer, as the page gets it back."""

    id: str
    number: int
    play: int
    started_at_client: datetime
    ended: bool
    outcome: Outcome | None
    showings: list[ViewShowing] | None
    clips: list[SeenClip]
    disturbances: dict[str, int]
