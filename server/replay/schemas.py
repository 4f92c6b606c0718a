"""A run's trials as they were shown, for the page that plays them back."""

from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field

from experiments.definition.display import Display
from experiments.trials.union import AnyPage
from server.text import VisibleObject
from server.trials.measures import Role
from server.views.schemas import Outcome, ViewShowing


class ReplayedClip(BaseModel):
    """A clip of a trial, with what gives its size on the participant's screen."""

    clip_sha256: str
    clip_url: str
    cell: str
    exemplar: int
    frames: int
    fps: float
    width_px: int
    height_px: int
    width_mm: float | None
    inter_ocular_px: float | None


class FrameLog(BaseModel):
    """What was drawn of one clip of a view."""

    role: Role
    clip_sha256: str
    drawn: list[tuple[int, float]] = Field(
        description="Index and time in ms since the view's start key of every drawn frame."
    )


class ReplayedView(BaseModel):
    """One view: what each clip's log says was drawn when, in ms since the view's start key."""

    number: int
    from_answer: bool = Field(
        description="True where the run is older than the ledger of views: rebuilt from the answer's log."
    )
    started_at_client: datetime | None
    ended_at_client: datetime | None
    outcome: Outcome | None = Field(description="Null where the view was left open, or is rebuilt.")
    screen: VisibleObject = Field(description="Window and screen at the view's start.")
    showings: list[ViewShowing] | None
    clips: list[FrameLog]
    disturbances: dict[str, int] = Field(description="How often each disturbed this view.")


class ReplayedPlay(BaseModel):
    """One play of a trial: its views, its answer and the verdict; no answer where the page never sent one."""

    play: int
    px_per_mm: float | None = Field(description="CSS pixels per mm by the calibration that was in force.")
    views: list[ReplayedView]
    answer: dict[str, Any] | None = Field(description="As its kind of trial stores it.")
    rt: float | None = Field(description="From the clip's last frame to the answer, ms.")
    rt_from_first_frame: float | None
    answered_at_client: datetime | None
    comment: str | None
    method: str | None
    verdict: str | None
    verdict_rule: str
    refresh_rate_hz: float | None
    device_pixel_ratio: float | None


class ReplayedEvent(BaseModel):
    """Something that happened around a trial, by the participant's clock."""

    type: str
    at_client: datetime
    data: VisibleObject


class ReplayedTrial(BaseModel):
    """One trial with all its plays."""

    trial_index: int
    clips: list[ReplayedClip] = Field(description="Every clip that a view names or the trial was assigned.")
    expected_response: int | None
    plays: list[ReplayedPlay]
    events: list[ReplayedEvent]


class ClipInRole(BaseModel):
    """Which clip a trial was assigned in which role."""

    role: Role
    cell: str
    exemplar: int


class ReplayableTrial(BaseModel):
    """One line of the list of trials."""

    trial_index: int
    kind: str
    block: int
    block_label: str
    clips: list[ClipInRole]
    plays: int
    views: int
    verdict: str | None = Field(description="Of the last play; null without an answer.")


class Replay(BaseModel):
    """A run that can be played back, and what its trials looked like."""

    run: str
    participant: str
    origin: str
    language: str
    erased: bool
    trial: AnyPage
    display: Display
    trials: list[ReplayableTrial]
