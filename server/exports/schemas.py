"""What an export holds, and the bodies of requests for capsules and reports."""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal, get_args

from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy import ColumnElement

from server.core.values import Number
from server.models import Study, StudyRun
from server.studies.repository import ids_of_series

# What of a study's data an export holds: one origin, or all of them; one data series, or every one.

ExportOrigin = Literal["participant", "pilot", "simulated", "all"]
"""Previews are in no export: they are stored for a day only."""
EXPORTED = get_args(ExportOrigin)[:-1]


@dataclass(frozen=True)
class Extract:
    """The part of a study's data that goes out; without a series, of each, distinguished by a column.

    Attributes
    ----------
    origin : ExportOrigin
    series : int or None
    old_order : bool
        Whether columns are in the order used until 0.2.
    """

    origin: ExportOrigin = "participant"
    series: int | None = None
    old_order: bool = False

    def condition(self, study: Study) -> ColumnElement[bool]:
        """The condition that a run of the study is in it."""
        origins = EXPORTED if self.origin == "all" else (self.origin,)
        runs = (StudyRun.study_id == study.id) & StudyRun.origin.in_(origins)
        if self.series is None:
            return runs
        return runs & StudyRun.version_id.in_(ids_of_series(study, self.series))

    def __str__(self) -> str:
        """In words, as READMEs have it."""
        one, every = f"the origin `{self.origin}` alone", "all origins, distinguished by `run_origin`"
        series = "" if self.series is None else f", data series {self.series} alone"
        return (every if self.origin == "all" else one) + series

    @property
    def file_part(self) -> str:
        """What file names say of it: nothing for participants of every series."""
        origin = "" if self.origin == "participant" else f"-{self.origin}"
        return origin + ("" if self.series is None else f"-series-{self.series}")


EVERYTHING = Extract("all")


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
