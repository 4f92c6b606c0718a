"""What the endpoints of a study's life cycle take and give: copies, the archive, comparisons."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, Field, StringConstraints

from server.numbers import Number
from server.request_body import RequestBody
from server.studies.fields import Revision, StudyName


class CloneStudy(RequestBody):
    """A copy of a study under a name of its own."""

    name: StudyName
    version: Number | None = Field(
        default=None, description="The version to copy; the active one where none is given."
    )
    workspace: Annotated[str, StringConstraints(max_length=60)] | None = Field(
        default=None,
        description="Where the copy goes; needed where one may make no studies beside its source.",
    )


class ArchiveStudy(RequestBody):
    """Put a study into the archive, or take it out."""

    revision: Revision
    archived: bool


class Piece(BaseModel):
    """Words of a text that stayed, went or came."""

    kind: Literal["same", "gone", "new"]
    text: str


class KeyDifference(BaseModel):
    """One key of the declaration that differs."""

    path: str
    effect: Literal["wording", "measured"]
    pieces: list[Piece] = Field(description="The old value with what went from it and came to it.")


class ClipDifference(BaseModel):
    """A clip that one of the versions lacks, or that has other bytes in each."""

    kind: Literal["gone", "new", "replaced"]
    cell: str
    exemplar: int
    old_file: str | None
    new_file: str | None


class ComparedVersion(BaseModel):
    """One side of a comparison."""

    study: str
    version: int
    series: int
    created_at: datetime
    note: str


class Comparison(BaseModel):
    """What differs between two versions, of one study or of two."""

    old: ComparedVersion
    new: ComparedVersion
    pooled: bool = Field(description="Whether both measure the same, by the same clips.")
    keys: list[KeyDifference] = Field(description="Of the declaration, what is measured first.")
    clips: list[ClipDifference] = Field(description="At most 200 of them.")
    clips_differing: int
    clips_same: int
