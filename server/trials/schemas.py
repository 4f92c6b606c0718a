"""One rating as the page sends it, and the receipt it gets."""

from collections.abc import Set
from datetime import datetime
from typing import Annotated, Any, Literal, Self
from uuid import UUID

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    StringConstraints,
    model_validator,
)

from experiments.checks import CheckName
from experiments.trials.clip_rating.declaration import MAX_FRAMES_LOGGED
from experiments.trials.clip_rating.scales import SCALE_NAME
from experiments.trials.union import AnyAnswer
from server.evidence.schemas import RatingEvidence
from server.trials.measures import Count, DisturbanceCounts, FrameTime, Milliseconds, Role
from server.trials.unknown_values import ANY, IMPOSSIBLE, LEFT_OUT, Path, validated
from server.views.schemas import ViewState

RATINGS = "/api/run/ratings/"
RunStatus = Literal["active", "complete", "screened_out", "withdrawn"]


class ShownClip(BaseModel):
    """One of several clips of a trial; the log of drawn frames is that of all, since one clock draws them."""

    clip_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
    frames_drawn: Count
    frames_missing: Count


class ShownClips(BaseModel):
    """The clips of a trial by their roles; those that its kind does not show are left out."""

    model_config = ConfigDict(extra="forbid")

    shown: ShownClip | None = None
    left: ShownClip | None = None
    right: ShownClip | None = None
    first: ShownClip | None = None
    second: ShownClip | None = None
    reference: ShownClip | None = None

    def by_role(self) -> dict[str, ShownClip]:
        """The clips that are there."""
        return {role: clip for role, clip in self if clip is not None}


class PlaybackLog(BaseModel):
    """What the page measured while the clip played; null where it could not."""

    method: Literal["webcodecs", "video", "none"]
    clip_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")] | None = None
    clips: ShownClips | None = Field(
        default=None, description="Of each clip, by its role, where a trial shows several."
    )
    key_to_first_frame_ms: Milliseconds | None = None
    frames_drawn: Count | None = None
    frames_late: Count | None = None
    frames_missing: Count | None = None
    longest_gap_ms: Milliseconds | None = None
    clock_gap_ms: Milliseconds | None = Field(
        default=None, description="Longest time between two callbacks of the animation clock."
    )
    clock_late_ms: Annotated[float, Field(ge=-1e10, le=1e10, allow_inf_nan=False)] | None = Field(
        default=None, description="Longest time by which a callback ran after its refresh."
    )
    stalls: Count | None = None
    focus_lost: Count | None = Field(default=None, description="How often focus was lost.")
    disturbances: DisturbanceCounts | None = Field(
        default=None,
        description="How often each of [playback.disturbances] disturbed the views.",
    )
    refresh_rate_hz: Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)] | None = None
    device_pixel_ratio: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] | None = None
    drawn: Annotated[list[FrameTime], Field(max_length=MAX_FRAMES_LOGGED)] | None = Field(
        default=None,
        description="Index and time in ms since the start key of every drawn frame, view after view.",
    )


_MEASURED: dict[Path, Any] = {
    **{(name,): None for name in ("rt", "rt_from_first_frame", "time_elapsed", "answered_at_client")},
    ("changes",): LEFT_OUT,
    **{
        ("playback", name): None
        for name in PlaybackLog.model_fields
        if name not in ("method", "clip_sha256", "disturbances")
    },
    ("playback", "disturbances", ANY): LEFT_OUT,
    ("playback", "disturbances"): None,
    ("evidence", "interaction", "press_ms"): None,
    ("answer", "answers", ANY, "rt"): None,
    ("answer", "reference_gap_ms"): None,
    ("answer", "moves"): LEFT_OUT,
}
"""What a browser, and not the participant, says of a play, and what is stored where it cannot be."""


def _count_unknown(data: Any, unknown: Set[Path]) -> None:
    playback = data.get("playback")
    if isinstance(playback, dict):
        told = playback.get("disturbances")
        playback["disturbances"] = {**(told if isinstance(told, dict) else {}), IMPOSSIBLE: len(unknown)}


class RatingIn(BaseModel):
    """One play of one trial with its answer, whose `kind` is that of the study's trials.

    Pages of before send a rating as `response`, a whole number or null.
    """

    trial_index: Count
    play: Annotated[int, Field(ge=1, le=100)] = 1
    answer: AnyAnswer
    rt: Milliseconds | None = Field(default=None, description="From the clip's last frame to the answer, ms.")
    rt_from_first_frame: Milliseconds | None = None
    time_elapsed: Milliseconds | None = Field(
        default=None, description="From the run's start to the answer, ms."
    )
    changes: Count = 0
    comment: Annotated[str, StringConstraints(max_length=5000)] | None = None
    answered_at_client: datetime | None = None
    playback: PlaybackLog
    evidence: RatingEvidence | None = None

    @model_validator(mode="wrap")
    @classmethod
    def _whatever_was_measured(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """A number that no browser can have measured is unknown, and counted; the answer is stored."""
        return validated(data, handler, _MEASURED, _count_unknown)

    @model_validator(mode="before")
    @classmethod
    def _of_an_older_page(cls, data: Any) -> Any:
        """The answer with its kind: older pages send `response`, null beside the answer to a pair."""
        if not isinstance(data, dict) or "response" not in data:
            return data
        if data.get("answer") is None:
            rated = {SCALE_NAME: {"response": data["response"]}}
            return {**data, "answer": {"kind": "clip_rating", "answers": rated}}
        if data["response"] is not None:
            raise ValueError(f"expected an answer alone, got the response {data['response']!r:.40} beside it")
        if isinstance(data["answer"], dict):
            return {**data, "answer": {"kind": "paired_comparison", **data["answer"]}}
        return data


class RefusedRecord(BaseModel):
    """A record that was refused for good, as the page sent it, with the answer that it got."""

    id: UUID = Field(description="Of the record in the page's outbox.")
    path: Annotated[str, StringConstraints(max_length=300)] = Field(description="Where it was sent.")
    status: Annotated[int, Field(ge=400, le=499)]
    code: Annotated[str, StringConstraints(max_length=100)]
    message: Annotated[str, StringConstraints(max_length=2000)] = ""
    body: dict[str, Any] = Field(default_factory=dict, description="The record itself.")

    @property
    def which(self) -> tuple[int, int] | None:
        """The trial's index and the play, where it is an answer to one."""
        trial_index, play = self.body.get("trial_index"), self.body.get("play", 1)
        if not self.path.startswith(RATINGS) or type(trial_index) is not int or type(play) is not int:
            return None
        return (trial_index, play) if 0 <= trial_index <= 1_000_000 and 1 <= play <= 100 else None


class TrialClip(BaseModel):
    """One clip of a trial, and the role in which it is shown; it is at `/clips/{clip_sha256}.mp4`.

    Every clip of a trial is shown at the size of the first, which stands with the trial.
    """

    role: Role
    clip_sha256: str
    frames: int
    fps: float


class SeriesPosition(BaseModel):
    """Where a trial stands in an adaptive series, and how much of it the choice of its clip knew."""

    number: int = Field(description="Which series, from 0.")
    position: int = Field(description="Position in the series, from 1.")
    known: int = Field(
        description="Answers of the series that the choice rests on; sent back with the answer."
    )


class TrialInfo(BaseModel):
    """One trial as the page needs it; nothing tells the participant which cell it is."""

    trial_index: int
    kind: Literal["practice", "main", "attention", "check"]
    block: int
    clip_sha256: str | None
    frames: int | None
    fps: float | None
    width_px: int | None
    height_px: int | None
    width_mm: float | None
    inter_ocular_px: float | None
    clips: list[TrialClip] = Field(description="Every clip, in the order of its places.")
    prompt: str | None = Field(description="Markdown of an attention check.")
    check: CheckName | None = Field(
        default=None, description="What kind of motion check it is; its answer is told nobody."
    )
    plays_done: int
    plays_wanted: int
    answered: bool
    views_begun: int = Field(description="The highest number of a view of this trial; 0 where it has none.")
    views: list[ViewState] = Field(description="Views that still wait for the answer of their play.")
    series: SeriesPosition | None = Field(default=None, description="Of trials that answers decide on.")


class WarningShown(BaseModel):
    """A kind word to who answers without care; the page shows it before the next trial."""

    rule: str = Field(description="The rule of [[warnings.rules]] that the latest answers break.")
    number: int = Field(description="Which warning of this run it is, from 1.")
    maximum: int = Field(description="How many there are.")
    text: str = Field(description="Markdown, in the participant's language.")


class Receipt(BaseModel):
    """The rating is on disk."""

    rating_id: str
    saved_at: datetime
    verdict: Literal["good", "uncertain", "flagged", "failed"]
    rule: str = Field(description="The rule that gave the verdict, empty where good.")
    again: bool = Field(description="Show the clip again at the end of its block, as the next play.")
    remaining: int = Field(description="Trials of the run that still need an answer.")
    status: RunStatus = Field(description="Of the run: screened_out where this answer ended it.")
    warning: WarningShown | None = Field(
        default=None, description="To be shown before the next trial; left out where there is none."
    )


class NextTrials(BaseModel):
    """What an answer changes of the trials to come, in a study whose answers decide what is shown."""

    trials: list[TrialInfo] = Field(description="The next trials of each series, as chosen from all answers.")
    closed: list[int] = Field(description="Trials that need no answer, since their series has ended.")


class RatingSaved(BaseModel):
    """The answer to a rating."""

    receipt: Receipt
    next: NextTrials | None = Field(
        default=None, description="Where answers decide what is shown next; left out where they do not."
    )
