"""What the endpoints of studies take and give: new ones, versions, status and settings, the list."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from experiments.definition import Experiment
from server.models import Right
from server.participants.recruiter import Recruiter
from server.request_body import RequestBody
from server.studies.clip_schemas import LevelsPattern, LevelsTable, OwnClips
from server.studies.definition_schemas import DesignOut
from server.studies.fields import Label, Revision, StudyName, TomlText


class ShippedExperiment(BaseModel):
    """An experiment that comes with the program."""

    name: str
    title: str
    toml: str
    demonstration: bool = Field(description="True for those that are none of the paper's experiments.")
    clips_ready: bool = Field(description="True where `stimuli build` has made its clips on this server.")
    build: str = Field(description="The command that builds its clips where this server looks for them.")


class NewStudy(RequestBody):
    """A study from a shipped experiment, from a definition, or from uploaded clips."""

    name: StudyName
    shipped: str | None = None
    toml: TomlText | None = None
    upload: str | None = None
    levels: LevelsTable | LevelsPattern | None = None
    own_clips: OwnClips | None = None
    workspace: Annotated[str, StringConstraints(max_length=60)] | None = Field(
        default=None, description="Needed where the account may make studies in several workspaces."
    )


class NewVersion(RequestBody):
    """A changed definition; it becomes a new version."""

    revision: Revision
    toml: TomlText
    note: Label = ""
    upload: str | None = Field(default=None, description="Clips to add, or to put in the place of others.")
    levels: LevelsTable | LevelsPattern | None = None


class ChangeStatus(RequestBody):
    """Open or close a study."""

    revision: Revision
    status: Literal["draft", "pilot", "live", "closed"]


class ChangeSettings(RequestBody):
    """Pause, quota and recruiter."""

    revision: Revision
    paused: bool
    quota: Annotated[int, Field(ge=1, le=1_000_000)] | None
    recruiter: Recruiter | None


class LaunchCheck(BaseModel):
    """Something to look at before a study goes live."""

    kind: str = Field(description="What was checked.")
    blocks: bool = Field(description="The study cannot go live like this.")
    text: str = Field(description="What was found and what to do, in a sentence.")


class SeriesOut(BaseModel):
    """Versions of a study that measure the same; only their answers may be pooled."""

    number: int
    name: str
    versions: list[int]
    runs: dict[str, int] = Field(description="Runs by origin, previews left out.")


class VersionOut(BaseModel):
    """A version of a study."""

    model_config = ConfigDict(from_attributes=True)
    number: int
    experiment: str
    definition_sha256: str
    series: int
    note: str
    created_at: datetime
    runs: int = 0


class StudySummary(BaseModel):
    """One line of the list of studies."""

    name: str
    title: str
    status: Literal["draft", "pilot", "live", "closed"]
    paused: bool
    quota: int | None
    version: int
    revision: int
    complete: int
    active: int
    created_at: datetime
    archived_at: datetime | None
    workspace: str = Field(description="Name of the workspace it belongs to.")
    rights: list[Right] = Field(description="What the account that asks may do with it.")


class StudyDetail(BaseModel):
    """A study with its declaration."""

    summary: StudySummary
    design: DesignOut
    definition: Experiment
    toml: str
    definition_sha256: str
    versions: list[VersionOut]
    series: list[SeriesOut]
    recruiter: dict[str, Any] | None
