"""Analysis reports built on request."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict


class NewReport(BaseModel):
    """Which data to analyse."""

    model_config = ConfigDict(extra="forbid")
    phase: Literal["pilot", "live"] = "live"
    sensitivity: bool = True


class ReportOut(BaseModel):
    """A report that waits, runs, is done or has failed (then `message` says why)."""

    id: str
    status: Literal["queued", "running", "done", "failed", "cancelled"]
    progress: float
    message: str
    phase: str
    created_at: datetime
    finished_at: datetime | None
    files: list[str]
