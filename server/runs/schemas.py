"""One participant's visit as the experimenter sees it."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from server.text import VisibleObject


class Exclude(BaseModel):
    """Why a run is excluded; kept with the data."""

    model_config = ConfigDict(extra="forbid")
    reason: Annotated[str, StringConstraints(strip_whitespace=True, min_length=3, max_length=500)]


class Erase(BaseModel):
    """The run's identifier once more, as a guard against a slip."""

    model_config = ConfigDict(extra="forbid")
    confirm: Annotated[str, StringConstraints(max_length=40)]


class HeldReport(BaseModel):
    """A report that was made while the person's data were there."""

    report: str
    finished_at: datetime | None


class Erased(BaseModel):
    """What was erased, and what still holds the person until it is made again or removed."""

    runs: list[str] = Field(description="The run asked for, and other visits of the same person.")
    reports: list[HeldReport] = Field(description="Reports of the study; make them again.")
    ledger: str = Field(
        description="File from which a restore of an older backup erases these runs again; keep it."
    )


class RunIdentity(BaseModel):
    """Who a participant is to the recruiter."""

    run: str
    participant: str = Field(description="The study's pseudonym.")
    identifier: str = Field(description="The recruiter's id; empty where the address named nobody.")
    parameters: VisibleObject = Field(description="Of the address by which the participant came.")
    link: str = Field(description="Label of the link.")


Show = Literal["everybody", "complete", "not_complete", "excluded", "pilot", "simulated"]


class RunSummary(BaseModel):
    """One line of the participants page."""

    run: str
    participant: str
    phase: str
    origin: str
    status: str
    stage: str
    language: str
    started_at: datetime
    last_seen_at: datetime
    completed_at: datetime | None
    minutes: float = Field(description="From start to end, or to the last sign of life.")
    trials: int
    answered: int
    not_good: int = Field(description="Plays that were flagged or failed.")
    refused: int = Field(description="Answers and views that could not be stored; the timeline has why.")
    excluded: bool
    exclusion_reason: str | None
    erased_at: datetime | None
    version: int
    link: str


class RunPage(BaseModel):
    """Runs, the latest first."""

    runs: list[RunSummary]
    total: int = Field(description="How many runs fit, on all pages.")
    next: str | None = Field(description="Ask again with `before` = this; null at the end.")


class TimelineTrial(BaseModel):
    """One play of one trial with its answer and what was shown."""

    trial_index: int
    kind: str
    block: int
    cell: str | None
    exemplar: int | None
    clip_sha256: str | None
    play: int
    answer: dict[str, Any] = Field(description="As its kind of trial stores it.")
    response: float | None = Field(description="The answer on the scale, of kinds that have one.")
    expected_response: int | None
    rt: float | None
    comment: str | None
    method: str
    verdict: str
    verdict_rule: str
    key_to_first_frame_ms: float | None
    frames_drawn: int | None
    frames_late: int | None
    frames_missing: int | None
    longest_gap_ms: float | None
    focus_lost: bool | None
    drawn: list[list[float]] | None
    saved_at: datetime


class TimelineEvent(BaseModel):
    """Something that happened around the trials."""

    type: str
    at_client: datetime | None
    received_at: datetime
    data: VisibleObject


class TimelineForm(BaseModel):
    """The answers of one form."""

    form: str
    answers: VisibleObject
    saved_at: datetime


class TimelineCalibration(BaseModel):
    """One size calibration."""

    model_config = ConfigDict(from_attributes=True)
    px_per_mm: float
    method: str
    viewing_distance_mm: float | None
    zoom: float
    saved_at: datetime
    occasion: str
    repeats: int | None
    spread_percent: float | None
    ruler_check: str | None
    distance_method: str | None
    distance_spread_mm: float | None
    distance_typed_mm: float | None
    recheck_percent: float | None


class Timeline(BaseModel):
    """One run, complete."""

    summary: RunSummary
    device: VisibleObject
    consented_at: datetime | None
    trials: list[TimelineTrial]
    events: list[TimelineEvent]
    forms: list[TimelineForm]
    calibrations: list[TimelineCalibration]
