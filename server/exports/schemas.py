"""Capsules and reports built on request."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from server.core.values import Number

# Capsules built on request.


class NewCapsule(BaseModel):
    """What a capsule is to hold."""

    model_config = ConfigDict(extra="forbid")
    origin: Literal["participant", "pilot", "simulated"] = "participant"
    series: Number | None = Field(
        default=None,
        description=(
            "Include only this data series: its data, definition, clips and report. By default, "
            "the data of every series, and everything else of the active version."
        ),
    )
    clips: bool = Field(default=True, description="Include the clips; their hashes are always included.")
    sensitivity: bool = Field(default=True, description="Include the slow models of the report.")


class CapsuleOut(BaseModel):
    """A capsule that waits, is made, is done or has failed (then `message` says why)."""

    id: str
    status: Literal["queued", "running", "done", "failed", "cancelled"]
    progress: float
    message: str
    origin: str
    series: int | None
    clips: bool
    created_at: datetime
    bytes: int | None = Field(description="Size of the zip in bytes; null until it is finished.")
    sha256: str | None = Field(description="Its hash, as `analysis verify` prints it.")


# Analysis reports built on request.


class NewReport(BaseModel):
    """Which data to analyse."""

    model_config = ConfigDict(extra="forbid")
    origin: Literal["participant", "pilot", "simulated"] = "participant"
    series: Number | None = Field(
        default=None, description="Data series; by default, that of the active version."
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
