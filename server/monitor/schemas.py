"""What the live monitor shows."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from server.evidence.verdict import Verdict
from server.participants.schemas import Origin


class MonitoredRun(BaseModel):
    """One visit in the monitor's table."""

    run: str
    participant: str
    phase: str
    origin: str
    status: str
    stage: str
    presence: Literal["here", "away", "dropped", "finished"] = Field(
        description="here: seen within a minute; away: active but silent; dropped: silent beyond the lease."
    )
    started_at: datetime
    last_seen_at: datetime
    answered: int
    trials: int
    uncertain: int
    flagged: int
    failed: int
    excluded: bool
    evidence_verdict: Verdict | None = Field(
        description="Whether the answers are likely a person's; null while the run goes on."
    )
    heat: str = Field(description="One letter a trial: . open, g good, u uncertain, f flagged, x failed.")


class FunnelStep(BaseModel):
    """How many runs came at least this far."""

    stage: str
    runs: int


class GroupCount(BaseModel):
    """How many took part in one group."""

    name: str
    quota: int | None
    complete: int
    active: int


class MonitorSnapshot(BaseModel):
    """Everything the monitor shows at one moment."""

    study: str
    study_status: str
    quota: int | None
    server_time: datetime
    origin: Origin = Field(description="Whose runs are listed and counted.")
    others: dict[str, int] = Field(description="Runs of other origins, previews left out.")
    complete: int
    active: int
    dropped: int
    screened_out: int
    withdrawn: int
    refused_browsers: int
    groups: list[GroupCount] = Field(description="Groups of participants; empty where there is one only.")
    funnel: list[FunnelStep]
    expected_finish: datetime | None = Field(
        description="When the quota will be full at the pace of the last day; null where it cannot be said."
    )
    total: int = Field(description="Runs of this origin.")
    runs: list[MonitoredRun] = Field(description="The latest, in the order they began; not more than 500.")


class FailingClip(BaseModel):
    """A clip that people could not see: no play of its trial was better than failed."""

    clip_sha256: str
    file: str
    cell: str
    people: int = Field(description="Who came to a trial with this clip, in the latest 500 runs.")
    failed_for: int = Field(description="Of these people, those who could not see it.")
    rules: dict[str, int] = Field(description="Why its plays failed: rule and number of plays.")
    reason: str = Field(description="What most browsers said of it; empty where none did.")
    alarm: bool = Field(description="It failed for everybody, or for half of several people or more.")
