"""What the results page shows."""

from datetime import datetime

from pydantic import BaseModel, Field


class Mean(BaseModel):
    """A marginal or cell mean over participants."""

    levels: dict[str, str]
    mean: float
    se_within: float | None = Field(description="Within-participant standard error (Cousineau-Morey).")
    participants: int


class Margin(BaseModel):
    """The means of one factor, of two crossed factors, or of all (the cells)."""

    factors: list[str]
    means: list[Mean]


class ClipResult(BaseModel):
    """The answers one clip got."""

    clip_sha256: str
    file: str
    cell: str
    exemplar: int
    ratings: int
    mean: float | None
    counts: list[int] = Field(description="Answers per scale point, from the lowest.")


class CellResult(BaseModel):
    """The answers one cell got."""

    cell: str
    ratings: int
    mean: float | None
    counts: list[int]


class TimeBin(BaseModel):
    """Answers within 250 ms from `start_ms` after the clip's end."""

    start_ms: int
    answers: int


class Playback(BaseModel):
    """How the clips were shown."""

    verdicts: dict[str, int]
    methods: dict[str, int]
    rules: dict[str, int]
    key_to_first_frame_ms: list[int] = Field(
        description="Plays per bin of 10 ms, from 0; the last bin is open."
    )


class Results(BaseModel):
    """The results of a study so far; nothing here replaces the analysis."""

    study: str
    origin: str
    series: int
    counted_at: datetime
    participants: int
    ratings: int
    scale_minimum: int
    scale_maximum: int
    margins: list[Margin]
    cells: list[CellResult]
    clips: list[ClipResult]
    response_times: list[TimeBin]
    playback: Playback
