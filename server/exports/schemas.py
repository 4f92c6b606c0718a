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
        description="Its data, definition, clips and report alone. Where none is given it holds the data of "
        "every series, and all else of the active version.",
    )
    clips: bool = Field(default=True, description="Put the clips in; their hashes are in it always.")
    sensitivity: bool = Field(default=True, description="With the models of the report that take long.")


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
    bytes: int | None = Field(description="Length of the zip; null until it is there.")
    sha256: str | None = Field(description="What `analysis verify` prints of it.")


# Analysis reports built on request.


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
