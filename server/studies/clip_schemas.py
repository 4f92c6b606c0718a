"""What the endpoints of clips take and give: uploads, levels of own clips, the clips of a study."""

from typing import Annotated, Literal

from pydantic import BaseModel, Field, StringConstraints

from experiments.source_video import FrameRate, SourceVideo
from server.request_body import RequestBody
from server.studies.fields import Label


class LevelsTable(RequestBody):
    """A CSV with one row a clip: column `file`, then one column a factor; `exemplar` is optional."""

    csv: Annotated[str, StringConstraints(max_length=2_000_000)]


class LevelsPattern(RequestBody):
    """A pattern that file names follow, such as `{character}_{speed}_{exemplar}.mp4`."""

    pattern: Annotated[str, StringConstraints(min_length=3, max_length=300)]


Template = Literal["rating", "slider", "sliders", "acr", "dcr", "pairs", "just_noticeable"]


class OwnClips(RequestBody):
    """What to ask about one's own clips, where no definition is given.

    The template says what participants do; `low` and `high` are for rating and sliders alone.
    """

    template: Template = "rating"
    title: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=300)]
    question: Label = "How natural was this clip?"
    low: Label = "very unnatural"
    high: Label = "very natural"


class ClipOut(BaseModel):
    """A clip of a study, with the curve it shows."""

    clip_sha256: str
    url: str
    file: str
    cell: str
    levels: dict[str, str]
    exemplar: int
    profile: str
    fps: float
    frames: int
    width_px: int
    height_px: int
    bytes: int
    closure: list[float]
    source: SourceVideo | None = Field(
        description="What it was converted from, without its frame map; null where it is shown as it came."
    )


class UploadedFile(BaseModel):
    """One file of an upload: what it is, or why it cannot be used."""

    name: str
    bytes: int
    state: Literal["waiting", "ready", "refused"] = Field(
        description="Waiting: it is still looked into, or converted."
    )
    sha256: str | None = Field(default=None, description="Of the clip.")
    fps: float | None = None
    frames: int | None = None
    width_px: int | None = None
    height_px: int | None = None
    problem: str | None = Field(default=None, description="Why it cannot be used, and what to do.")
    same_as: str | None = Field(default=None, description="An earlier file with the same bytes.")
    source: SourceVideo | None = Field(
        default=None, description="What the clip was converted from; null where the file is shown as it came."
    )


class UploadProgress(BaseModel):
    """How far an upload has been looked into and converted."""

    files: int
    waiting: int
    refused: int
    left_out: int = Field(description="Files that are set aside; they are none of `files`.")


class LeaveOut(RequestBody):
    """Whether one file of an upload is left out of what is made of it."""

    file: str = Field(max_length=300)
    left_out: bool


class AskFrameRate(RequestBody):
    """The frame rate that clips are to have: one for all, or each its own."""

    fps: FrameRate | None


class UploadOut(BaseModel):
    """An upload waiting to become a study; it is deleted after a day."""

    id: str
    files: list[UploadedFile]
    waiting: int = Field(description="Files that are still looked into, or converted.")
    fps: float | None = Field(description="Frames per second asked for; null: each clip its own.")
    has_manifest: bool
    left_out: list[str] = Field(description="Names of the files that are set aside; they can be put back.")
    tables: list[str] = Field(description="Names of CSV files in the upload.")
    suggested_pattern: str | None
