"""What the results page shows."""

from datetime import datetime
from typing import Literal

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
    counts: list[int] = Field(description="Answers a bin, from the lowest.")


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


class StudyResults(BaseModel):
    """The results of a study so far, whatever its kind of trial; nothing here replaces the analysis."""

    study: str
    origin: str
    series: int
    counted_at: datetime
    participants: int
    ratings: int = Field(description="Answers of any kind that count.")
    response_times: list[TimeBin]
    playback: Playback


class ResultScale(BaseModel):
    """A scale as declared; answers are shown as they were chosen, reverse-keyed or not."""

    name: str
    type: str
    minimum: float
    maximum: float
    reverse: bool


class Results(StudyResults):
    """Ratings of single clips."""

    kind: Literal["clip_rating"] = "clip_rating"
    scales: list[ResultScale] = Field(description="Every scale of the study, in order.")
    scale: ResultScale = Field(description="The one whose answers these are.")
    bins: list[float] = Field(
        description="Lowest answer of each count: the scale's points, or equal parts of a slider."
    )
    margins: list[Margin]
    cells: list[CellResult]
    clips: list[ClipResult]


class PairChoices(BaseModel):
    """What was chosen between two cells, sides and exemplars taken together."""

    first: str
    second: str
    n: int
    first_chosen: int
    second_chosen: int
    ties: int


class LevelChoices(BaseModel):
    """A level of a factor in comparisons with cells of another level."""

    factor: str
    level: str
    n: int
    share: float | None = Field(description="Share in which the level was chosen, ties as half.")


class PairResults(StudyResults):
    """Paired comparisons."""

    kind: Literal["paired_comparison"] = "paired_comparison"
    pairs: list[PairChoices]
    levels: list[LevelChoices]
    left: int = Field(description="Answers for the clip on the left, or the first.")
    right: int
    ties: int


class StimulusAnswers(BaseModel):
    """The answers that counted at one stimulus of a series."""

    value: float = Field(description="The stimulus as a number.")
    second: float | None = Field(description="Its number along the second factor, where there is one.")
    n: int
    positive: int = Field(description="Yes, or the interval of the stimulus.")


class MeanTilt(BaseModel):
    """How far the threshold moves along the second factor: mean over people of their posterior means."""

    people: int
    mean: float = Field(description="Change of the threshold per unit of the second factor's numbers.")
    sd: float | None = Field(description="Standard deviation over people.")
    low: float | None = Field(description="95% t interval of the mean; null of one person.")
    high: float | None
    mean_posterior_sd: float = Field(description="Posterior SD of a person's tilt on average.")


class SeriesResult(BaseModel):
    """One adaptive series, over the people who are not excluded."""

    name: str
    levels: dict[str, str] = Field(description="Level of each factor but that of the stimulus.")
    people: int = Field(description="Runs with an estimate.")
    answers: int
    mean: float | None = Field(description="Mean of the people's latest thresholds.")
    sd: float | None = Field(description="Standard deviation of them.")
    mean_posterior_sd: float | None = Field(description="Posterior SD of an estimate on average.")
    stimuli: list[StimulusAnswers]
    thresholds: list[float] = Field(description="The people's latest thresholds, ascending.")
    tilt: MeanTilt | None = Field(description="Where series move over two factors and have answers.")


class ThresholdResults(StudyResults):
    """Adaptive series."""

    kind: Literal["threshold"] = "threshold"
    factor: str = Field(description="The factor along which series move.")
    second_factor: str | None = Field(description="The second factor, where series move over two.")
    second_middle: float | None = Field(description="Its number at which thresholds are told.")
    two_interval: bool
    series_results: list[SeriesResult]


class TraceCell(BaseModel):
    """The mean trace of one cell over people, each person's plays averaged before."""

    cell: str
    people: int
    traces: int
    left_out: int = Field(description="Traces of another sampling rate than the cell's first.")
    times_s: list[float] = Field(description="Seconds in the clip of each point.")
    mean: list[float]
    low: list[float] | None = Field(description="95% t interval over people; null of one person.")
    high: list[float] | None
    level: float = Field(description="Mean over the whole trace.")
    blinks_s: list[list[float]] = Field(description="Of each clip of the cell, when its blinks begin.")


class TraceResults(StudyResults):
    """Continuous ratings."""

    kind: Literal["continuous_rating"] = "continuous_rating"
    minimum: float
    maximum: float
    cells: list[TraceCell]


class OtherResults(StudyResults):
    """Of a kind of trial without a summary."""

    kind: Literal["other"] = "other"
    note: str


AnyResults = Results | PairResults | ThresholdResults | TraceResults | OtherResults
