"""What the pages of results, monitor, runs and replay show."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from experiments.declaration.tables import Display
from experiments.kinds import AnyPage
from server.core.values import VisibleObject
from server.participation.answer_schemas import Outcome, Role, ViewShowing
from server.participation.evidence import Verdict
from server.participation.run_schemas import Origin

# What the results page shows.


class Mean(BaseModel):
    """A marginal or cell mean over participants."""

    levels: dict[str, str]
    mean: float
    se_within: float | None = Field(description="Within-participant standard error (Cousineau-Morey).")
    low: float | None = Field(description="Limit of the 95% t interval by `se_within`.")
    high: float | None
    participants: int
    people: list[float] = Field(description="Means of single participants, at most 200, by their size.")


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
    second_middle: float | None = Field(description="Its number at which thresholds are given.")
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


class AnsweredCell(BaseModel):
    """The answers to trials that showed a cell, or one cell and then another."""

    cell: str
    second: str | None = Field(description="Cell of the other clip, where a trial shows two.")
    n: int
    mean: float = Field(description="Mean of the numbers that the answers count as.")


class OtherResults(StudyResults):
    """The results of a kind of trial without its own summary."""

    kind: Literal["other"] = "other"
    note: str
    cells: list[AnsweredCell]


AnyResults = Results | PairResults | ThresholdResults | TraceResults | OtherResults


# What the live monitor shows.


class MonitoredRun(BaseModel):
    """One visit in the monitor's table."""

    run: str
    participant: str
    phase: str
    origin: str
    status: str
    stage: str
    presence: Literal["here", "away", "dropped", "finished"] = Field(
        description="here: seen within a minute; away: active but silent; dropped: silent beyond the lease."
    )
    started_at: datetime
    last_seen_at: datetime
    answered: int
    trials: int
    main_answered: int = Field(description="Of `answered`, without practice, attention questions and checks.")
    main_trials: int = Field(description="Of `trials`, those that the study counts.")
    uncertain: int
    flagged: int
    failed: int
    excluded: bool
    evidence_verdict: Verdict | None = Field(
        description="Whether the answers are likely a person's; null while the run goes on."
    )
    heat: str = Field(description="One letter per trial: . open, g good, u uncertain, f flagged, x failed.")


class FunnelStep(BaseModel):
    """How many runs came at least this far."""

    stage: str
    runs: int


class GroupCount(BaseModel):
    """How many took part in one group."""

    name: str
    quota: int | None
    complete: int
    active: int


class MonitorSnapshot(BaseModel):
    """Everything the monitor shows at one moment."""

    study: str
    study_status: str
    quota: int | None
    server_time: datetime
    origin: Origin = Field(description="Whose runs are listed and counted.")
    others: dict[str, int] = Field(description="Runs of other origins, previews left out.")
    complete: int
    active: int
    dropped: int
    screened_out: int
    withdrawn: int
    refused_browsers: int
    groups: list[GroupCount] = Field(description="Groups of participants; empty where there is one only.")
    funnel: list[FunnelStep]
    expected_finish: datetime | None = Field(
        description="When the quota will be full at the pace of the last day; null where it cannot be said."
    )
    total: int = Field(description="Runs of this origin.")
    runs: list[MonitoredRun] = Field(description="The latest, in the order they began; not more than 500.")


class FailingClip(BaseModel):
    """A clip that people could not see: no play of its trial was better than failed."""

    clip_sha256: str
    file: str
    cell: str
    people: int = Field(description="Who came to a trial with this clip, in the latest 500 runs.")
    failed_for: int = Field(description="Of these people, those who could not see it.")
    rules: dict[str, int] = Field(description="Why its plays failed: rule and number of plays.")
    reason: str = Field(description="What most browsers said of it; empty where none did.")
    alarm: bool = Field(description="It failed for everybody, or for half of several people or more.")


# One participant's visit as the experimenter sees it.


class Exclude(BaseModel):
    """Why a run is excluded; kept with the data."""

    model_config = ConfigDict(extra="forbid")
    reason: Annotated[str, StringConstraints(strip_whitespace=True, min_length=3, max_length=500)]


class Erase(BaseModel):
    """The run's identifier once more, as a guard against a slip."""

    model_config = ConfigDict(extra="forbid")
    confirm: Annotated[str, StringConstraints(max_length=40)]


class HeldReport(BaseModel):
    """A report that was made while the person's data were there."""

    report: str
    finished_at: datetime | None


class Erased(BaseModel):
    """What was erased, and what still holds the person until it is made again or removed."""

    runs: list[str] = Field(description="The run asked for, and other visits of the same person.")
    reports: list[HeldReport] = Field(description="Reports of the study; make them again.")
    ledger: str = Field(
        description="File from which a restore of an older backup erases these runs again; keep it."
    )


class RunIdentity(BaseModel):
    """Who a participant is to the recruiter."""

    run: str
    participant: str = Field(description="The study's pseudonym.")
    identifier: str = Field(description="The recruiter's ID; empty where the address named nobody.")
    parameters: VisibleObject = Field(description="Of the address by which the participant came.")
    link: str = Field(description="Label of the link.")


Show = Literal["everybody", "complete", "not_complete", "excluded", "pilot", "simulated"]


class RunSummary(BaseModel):
    """One line of the participants page."""

    run: str
    participant: str
    phase: str
    origin: str
    status: str
    stage: str
    language: str
    started_at: datetime
    last_seen_at: datetime
    completed_at: datetime | None
    minutes: float = Field(description="From start to end, or to the last sign of life.")
    trials: int
    answered: int
    main_trials: int = Field(description="Trials that are neither practice nor a check.")
    main_answered: int
    not_good: int = Field(description="Plays that were flagged or failed.")
    refused: int = Field(description="Answers and views that could not be stored; the timeline has why.")
    excluded: bool
    exclusion_reason: str | None
    erased_at: datetime | None
    version: int
    link: str


class RunPage(BaseModel):
    """Runs, the latest first."""

    runs: list[RunSummary]
    total: int = Field(description="How many runs fit, on all pages.")
    next: str | None = Field(description="Ask again with `before` = this; null at the end.")


class TimelineClip(BaseModel):
    """A clip of a trial and the role it was shown in."""

    role: str
    cell: str
    exemplar: int
    clip_sha256: str


class TimelineTrial(BaseModel):
    """One play of one trial with its answer and what was shown."""

    trial_index: int
    kind: str
    block: int
    cell: str | None = Field(description="Of the trial's first clip.")
    exemplar: int | None
    clip_sha256: str | None
    clips: list[TimelineClip]
    play: int
    answer: dict[str, Any] = Field(description="As its kind of trial stores it.")
    response: int | float | None = Field(description="The answer on the scale, of kinds that have one.")
    expected_response: int | None
    rt: float | None
    rt_from_first_frame: float | None
    time_elapsed: float | None
    changes: int
    comment: str | None
    method: str
    verdict: str
    verdict_rule: str
    key_to_first_frame_ms: float | None
    frames_drawn: int | None
    frames_late: int | None
    frames_missing: int | None
    longest_gap_ms: float | None
    stalls: int | None
    focus_lost: bool | None
    clock_gap_ms: float | None
    clock_late_ms: float | None
    refresh_rate_hz: float | None
    device_pixel_ratio: float | None
    px_per_mm: float | None
    viewing_distance_mm: float | None
    disturbances: dict[str, int] | None
    drawn: list[list[int | float]] | None = Field(
        description="Frame and time in ms of every drawn frame of a trial's one clip."
    )
    playback: dict[str, Any] | None = Field(description="How each of several clips was shown, by its role.")
    saved_at: datetime


class TimelineEvent(BaseModel):
    """Something that happened around the trials."""

    type: str
    at_client: datetime | None
    received_at: datetime
    data: VisibleObject


class TimelineForm(BaseModel):
    """The answers of one form."""

    form: str
    answers: VisibleObject
    saved_at: datetime


class TimelineCalibration(BaseModel):
    """One size calibration."""

    model_config = ConfigDict(from_attributes=True)
    px_per_mm: float
    method: str
    viewing_distance_mm: float | None
    zoom: float
    saved_at: datetime
    occasion: str
    repeats: int | None
    spread_percent: float | None
    ruler_check: str | None
    distance_method: str | None
    distance_spread_mm: float | None
    distance_typed_mm: float | None
    recheck_percent: float | None


class RunEvidence(BaseModel):
    """Whether a run's answers are likely a person's, by what is stored now."""

    verdict: Verdict
    points: float
    reasons: list[str] = Field(description="What speaks against a person, in sentences.")


class Timeline(BaseModel):
    """One run, complete."""

    summary: RunSummary
    device: VisibleObject
    consented_at: datetime | None
    trials: list[TimelineTrial]
    events: list[TimelineEvent]
    forms: list[TimelineForm]
    calibrations: list[TimelineCalibration]


# A run's trials as they were shown, for the page that plays them back.


class ReplayedClip(BaseModel):
    """A clip of a trial, with what gives its size on the participant's screen."""

    clip_sha256: str
    clip_url: str
    cell: str
    exemplar: int
    frames: int
    fps: float
    width_px: int
    height_px: int
    width_mm: float | None
    inter_ocular_px: float | None


class FrameLog(BaseModel):
    """What was drawn of one clip of a view."""

    role: Role
    clip_sha256: str
    drawn: list[tuple[int, float]] = Field(
        description="Index and time in ms since the view's start key of every drawn frame."
    )


class ReplayedView(BaseModel):
    """One view: what each clip's log says was drawn when, in ms since the view's start key."""

    number: int
    from_answer: bool = Field(
        description="True where the run is older than the ledger of views: rebuilt from the answer's log."
    )
    started_at_client: datetime | None
    ended_at_client: datetime | None
    outcome: Outcome | None = Field(description="Null where the view was left open, or is rebuilt.")
    screen: VisibleObject = Field(description="Window and screen at the view's start.")
    showings: list[ViewShowing] | None
    clips: list[FrameLog]
    disturbances: dict[str, int] = Field(description="How often each disturbed this view.")


class ReplayedPlay(BaseModel):
    """One play of a trial: its views, its answer and the verdict; no answer where the page never sent one."""

    play: int
    px_per_mm: float | None = Field(description="CSS pixels per mm by the calibration that was in force.")
    views: list[ReplayedView]
    answer: dict[str, Any] | None = Field(description="As its kind of trial stores it.")
    rt: float | None = Field(description="From the clip's last frame to the answer, ms.")
    rt_from_first_frame: float | None
    answered_at_client: datetime | None
    comment: str | None
    method: str | None
    verdict: str | None
    verdict_rule: str
    refresh_rate_hz: float | None
    device_pixel_ratio: float | None


class ReplayedEvent(BaseModel):
    """Something that happened around a trial, by the participant's clock."""

    type: str
    at_client: datetime
    data: VisibleObject


class ReplayedTrial(BaseModel):
    """One trial with all its plays."""

    trial_index: int
    clips: list[ReplayedClip] = Field(description="Every clip that a view names or the trial was assigned.")
    expected_response: int | None
    plays: list[ReplayedPlay]
    events: list[ReplayedEvent]


class ClipInRole(BaseModel):
    """A clip that a trial was assigned, and its role."""

    role: Role
    cell: str
    exemplar: int


class ReplayableTrial(BaseModel):
    """One line of the list of trials."""

    trial_index: int
    kind: str
    block: int
    block_label: str
    clips: list[ClipInRole]
    plays: int
    views: int
    verdict: str | None = Field(description="Of the last play; null without an answer.")


class Replay(BaseModel):
    """A run that can be played back, and what its trials looked like."""

    run: str
    participant: str
    origin: str
    language: str
    erased: bool
    trial: AnyPage
    display: Display
    trials: list[ReplayableTrial]
