"""Analysis reports built on request."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from server.numbers import Number


class NewReport(BaseModel):
    """Which data to analyse."""

    model_config = ConfigDict(extra="forbid")
    origin: Literal["participant", "pilot", "simulated"] = "participant"
    series: Number | None = Field(
        default=None, description="Data series; that of the active version where none is given."
    )
    sensitivity: bool = True


class ReportOut(BaseModel):
    """A report that waits, runs, is done or has failed (then `message` says why)."""

    id: str
    status: Literal["queued", "running", "done", "failed", "cancelled"]
    progress: float
    message: str
    origin: str
    series: int | None
    created_at: datetime
    finished_at: datetime | None
    files: list[str]
