"""What the participant's page sends once a run has begun, or where none may begin."""

from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import BaseModel, Field, StringConstraints

from server.participants.schemas import DistanceMethod, Key, LanguageTag, Occasion, RulerCheck, Stage

EventType = Annotated[str, StringConstraints(pattern=r"^[a-z_]{1,30}$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Percent = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
Millimetres = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=0, le=100_000)]


class Consent(BaseModel):
    """The participant's answer on the consent page; false ends the run."""

    agreed: bool


class CalibrationResult(BaseModel):
    """One size calibration; each is kept, the latest counts.

    What has a default was not sent by the pages of before.
    """

    px_per_mm: Annotated[float, Field(gt=0, le=200, allow_inf_nan=False)]
    method: Literal["card", "ruler"]
    viewing_distance_mm: Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)] | None = None
    device_pixel_ratio: Positive
    screen_width_px: Pixels
    screen_height_px: Pixels
    window_width_px: Pixels
    window_height_px: Pixels
    zoom: Positive = 1.0
    occasion: Occasion = Field(default="first", description="Why it was made.")
    repeats: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="Measurements made, those included that differed too much."
    )
    spread_percent: Percent | None = Field(
        default=None, description="Largest less smallest of those that count, of their mean."
    )
    ruler_check: RulerCheck | None = Field(
        default=None, description="What a ruler said of the card's size; null where none was asked."
    )
    distance_method: DistanceMethod | None = None
    distance_spread_mm: Millimetres | None = Field(
        default=None, description="Standard deviation of the rounds of the blind-spot test."
    )
    distance_typed_mm: Millimetres | None = Field(
        default=None, description="The distance as it was typed in, where it was."
    )
    recheck_percent: Percent | None = Field(
        default=None, description="By how much a later measurement differed from the one before."
    )


class StageChange(BaseModel):
    """Where the participant is."""

    stage: Stage


class LanguageChange(BaseModel):
    """The language the participant reads from now on."""

    language: LanguageTag


class FormAnswers(BaseModel):
    """Answers by field name."""

    answers: dict[Key, Any] = Field(max_length=200)


class Event(BaseModel):
    """Something that happened in the page; `at` is the participant's clock."""

    id: UUID
    type: EventType
    at: datetime | None = None
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)


class Events(BaseModel):
    """Up to 100 events; those the server already has are left as they are."""

    events: list[Event] = Field(max_length=100)


class Unsupported(BaseModel):
    """A browser or screen that failed a gate before a run began."""

    link_token: Annotated[str, StringConstraints(max_length=100)]
    reason: Key
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)


class ScreenOut(BaseModel):
    """Why the browser or the screen will not do."""

    reason: Key
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)
