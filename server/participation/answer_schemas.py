"""Views and ratings as the page sends them, their evidence, and the receipt they get."""

import copy
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self, TypeVar
from uuid import UUID

from pydantic import (
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    StringConstraints,
    ValidationError,
    model_validator,
)

from experiments.checks import CheckName
from experiments.declaration.clip_rating import MAX_FRAMES_LOGGED
from experiments.kinds import AnyAnswer

# What pages measure of clips and views: bounded numbers and names.

# 1e10 ms are 115 days: no session lasts longer, and a clock since 1970 is above it.
Milliseconds = Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]
FrameTime = tuple[
    Annotated[int, Field(ge=0, le=1_000_000)], Annotated[float, Field(ge=-1e10, le=1e10, allow_inf_nan=False)]
]


Part = Literal["practice", "main", "attention", "check"]
"""What a trial is for."""
Verdict = Literal["good", "uncertain", "flagged", "failed"]
"""The verdict of the playback rules on a play (`server.participation.verdict`)."""
Role = Literal["shown", "left", "right", "first", "second", "reference"]
DisturbanceCounts = Annotated[
    dict[Annotated[str, StringConstraints(pattern=r"^[a-z_]{1,40}$")], Count], Field(max_length=20)
]


# A number that no clock or screen can have is stored as unknown: it costs nobody an answer.
#
# A browser may report any number. Where it breaks the bounds of its field, the answer is kept, the number
# becomes null, and the play records how many such numbers it had.

IMPOSSIBLE = "impossible_value"
"""Name of the disturbance that counts the numbers of a play that were made unknown."""
Path = tuple[str, ...]
Model = TypeVar("Model")
ANY = "*"
OF_VALUES = (
    "greater_than",
    "less_than",
    "finite_number",
    "int_",
    "float_",
    "datetime_",
    "timezone_",
    "too_long",
)
"""Faults of a value; those of a name or of a missing part are of the page, whatever its browser reports."""
MAX_PASSES = 4
"""A value can hide the fault of another: each look names those that are left."""
LEFT_OUT = object()
"""Stands for a value whose key is left out where it is unknown."""


def validate_measured(
    data: Any,
    validate: Callable[[Any], Model],
    measured: Mapping[Path, Any],
    count: Callable[[Any, Set[Path]], None],
) -> Model:
    """The model of what a page has sent, measured values that break their bounds made unknown.

    Parameters
    ----------
    data : Any
        As it was sent; it is left as it is.
    validate : callable
        Gives the model, or a ValidationError.
    measured : mapping of tuple of str to Any
        By the path of a measured value, its content if it is unknown; `*` is any key or index.
    count : callable
        Notes in the repaired data which values were made unknown.

    Raises
    ------
    ValidationError
        Something else is wrong, too.
    """
    try:
        return validate(data)
    except ValidationError as error:
        fault = error
    # Copied only here, as nearly every answer is valid as it was sent.
    repaired, unknown = copy.deepcopy(data), set[Path]()
    for _ in range(MAX_PASSES):
        for detail in fault.errors(include_url=False, include_context=False, include_input=False):
            is_value = detail["type"].startswith(OF_VALUES)
            cleared = _path_cleared(repaired, detail["loc"], measured) if is_value else None
            # One fault outside the measured values refuses the whole, whatever else could be repaired.
            if cleared is None:
                raise fault
            _clear_values(repaired, *cleared)
            unknown.add(cleared[0])
        # The count is a part of the data, so that it is validated and stored like any other.
        count(repaired, unknown)
        try:
            return validate(repaired)
        except ValidationError as error:
            fault = error
    # Every pass found a repairable fault and uncovered another.
    raise fault


def _path_cleared(
    data: Any, location: Sequence[int | str], measured: Mapping[Path, Any]
) -> tuple[Path, Any] | None:
    """The path in the data of the measured value with this fault, and what is to be there instead."""
    steps: list[str] = []
    here = data
    # From the outside in: an outer measured value may hold the faulty one and is cleared as a whole.
    for step in location:
        held = _value_at_step(here, step)
        # In a choice between models the fault names the chosen one, which is not a key of the data.
        if held is LEFT_OUT and isinstance(here, dict) and step == here.get("kind"):
            continue
        steps.append(str(step))
        here = held
        pattern = next((path for path in measured if _path_fits(path, steps)), None)
        if pattern is not None:
            return tuple(steps), measured[pattern]
    return None


def _value_at_step(value: Any, step: int | str) -> Any:
    if isinstance(value, dict):
        return value.get(step, LEFT_OUT)
    if isinstance(value, list) and isinstance(step, int) and step < len(value):
        return value[step]
    return LEFT_OUT


def _path_fits(path: Path, steps: Sequence[str]) -> bool:
    return len(path) == len(steps) and all(one in (ANY, step) for one, step in zip(path, steps, strict=True))


def _clear_values(data: Any, path: Path, unknown: Any) -> None:
    *above, last = path
    for step in above:
        # Every step is a string, also the index of a list.
        data = data[int(step)] if isinstance(data, list) else data.setdefault(step, {})
    if unknown is LEFT_OUT:
        data.pop(last, None)
    else:
        # A copy, since the same empty list would otherwise be shared by all places.
        data[last] = copy.deepcopy(unknown)


# What tickets and evidence look like between page and server.


class Tickets(BaseModel):
    """A sealed batch of tickets, with every trial's tickets: by trial index, then by play from 1 on."""

    batch: str
    by_trial: list[list[str]]


class Interaction(BaseModel):
    """How the participant acted between two answers, summed up on the page; no trace is sent.

    A press is a key or pointer button going down and up again, or an activation without one.
    """

    presses: Count
    trusted: Count = Field(description="Presses that the browser made from input, not a script.")
    press_ms: Milliseconds | None = Field(
        default=None, description="Median time from down to up; null where no press had both."
    )
    moves: Count = Field(default=0, description="Pointer movements.")

    # No measurement error leads to this: both are counted in the same place of the page.
    @model_validator(mode="after")
    def _trusted_are_presses(self) -> Self:
        if self.trusted > self.presses:
            raise ValueError(
                f"expected at most as many trusted presses as presses, got {self.trusted} of {self.presses}"
            )
        return self


class ViewEvidence(BaseModel):
    """What a view brings along: the ticket of its play, with the batch that it is of."""

    # Characters of base64url, and the dots between the parts of a sealed batch.
    batch: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9._-]{1,160}$")]
    ticket: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class RatingEvidence(ViewEvidence):
    """What a rating brings along to show how it came about."""

    digest: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None,
        description="HMAC-SHA-256, with the ticket as key, of the SHA-512 of each clip of the trial, joined.",
    )
    interaction: Interaction | None = None


# Views as the page sends them: when they begin, and once more when they have ended.

# The earliest and latest moments of the calendar have no UTC in it.
Moment = Annotated[
    AwareDatetime, Field(ge=datetime(1970, 1, 1, tzinfo=UTC), lt=datetime(9000, 1, 1, tzinfo=UTC))
]


class SeenClip(BaseModel):
    """One clip of a view with its drawn frames."""

    model_config = ConfigDict(extra="forbid")
    role: Role
    clip_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
    drawn: Annotated[list[FrameTime], Field(max_length=5000)] = Field(
        description="Index and time in ms since the view's start of every drawn frame."
    )


class ViewShowing(BaseModel):
    """What was measured of one clip of a view, or of several at once; its frames are with the clips.

    With it another page, or another device, can ask for the answer without a second view.
    """

    model_config = ConfigDict(extra="forbid")
    roles: Annotated[list[Role], Field(min_length=1, max_length=6)]
    method: Literal["webcodecs", "video"]
    frames: Count
    fps: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
    ended_ms: Milliseconds = Field(description="From the view's start key to the clip's end.")
    stalls: Count
    clock_gap_ms: Milliseconds | None
    clock_late_ms: Annotated[float, Field(ge=-1e10, le=1e10, allow_inf_nan=False)] | None
    focus_lost: Count
    visible_share: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = Field(
        default=None, description="Smallest share of the clip inside the window."
    )
    refresh_ms: Milliseconds | None = Field(
        default=None, description="Median time between refreshes during the clip."
    )


Outcome = Literal["shown", "interrupted"]


class ViewIn(BaseModel):
    """One view; sent without an end when it begins, with one when it has ended."""

    model_config = ConfigDict(extra="forbid")
    id: UUID
    trial_index: Count
    number: Annotated[int, Field(ge=1, le=1000)] = Field(description="Of the trial's views, from 1.")
    play: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="The play that it is part of; an older page has one view per play."
    )
    # Required, but may be null: a page must say that its clock cannot be right.
    started_at_client: Moment | None = Field(description="Null where the device's clock cannot be right.")
    ended_at_client: Moment | None = None
    screen: dict[Annotated[str, StringConstraints(max_length=100)], Any] = Field(
        default_factory=dict, max_length=50
    )
    # At most one clip for each role.
    clips: Annotated[list[SeenClip], Field(max_length=6)] = []
    outcome: Outcome | None = Field(
        default=None, description="How it ended: shown to its end, or broken off by a reload or a crash."
    )
    showings: Annotated[list[ViewShowing], Field(max_length=6)] | None = None
    disturbances: DisturbanceCounts = {}
    evidence: ViewEvidence | None = Field(
        default=None, description="The ticket of its play; an older page has none for views."
    )


_MEASURED_OF_VIEWS: dict[Path, Any] = {
    # As a whole, by its first fault: a showing of which a part is unknown is not asked about by another page.
    ("views", ANY, "showings"): None,
    # A log without frames, not null: the clip itself is still known.
    ("views", ANY, "clips", ANY, "drawn"): [],
    ("views", ANY, "started_at_client"): None,
    ("views", ANY, "ended_at_client"): None,
    ("views", ANY, "screen"): LEFT_OUT,
    ("views", ANY, "disturbances", ANY): LEFT_OUT,
    ("views", ANY, "disturbances"): LEFT_OUT,
}


def _count_unknown_of_views(data: Any, unknown: Set[Path]) -> None:
    # `path[1]` is the position of the view in the request.
    for index, number in Counter(path[1] for path in unknown).items():
        view = data["views"][int(index)]
        told = view.get("disturbances")
        # A page may have sent anything there; only a mapping can take the count.
        view["disturbances"] = {**(told if isinstance(told, dict) else {}), IMPOSSIBLE: number}


class ViewsIn(BaseModel):
    """Up to 100 views; what the server already has is left as it is."""

    model_config = ConfigDict(extra="forbid")
    views: list[ViewIn] = Field(max_length=100)

    @model_validator(mode="wrap")
    @classmethod
    def _whatever_was_measured(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """A number that no browser can have measured is unknown, and counted; the view is stored."""
        return validate_measured(data, handler, _MEASURED_OF_VIEWS, _count_unknown_of_views)


class ViewsSaved(BaseModel):
    """How many were new, how many were completed."""

    begun: int
    completed: int
    saved_at: datetime


class ViewState(BaseModel):
    """A view of a trial that still waits for its answer, as the page gets it back."""

    id: str
    number: int
    play: int
    started_at_client: datetime
    ended: bool
    outcome: Outcome | None
    showings: list[ViewShowing] | None
    clips: list[SeenClip]
    disturbances: dict[str, int]


# One rating as the page sends it, and the receipt it gets.

RATINGS = "/api/run/ratings/"
RunStatus = Literal["active", "complete", "screened_out", "withdrawn"]


class ShownClip(BaseModel):
    """One of several clips of a trial; the log of drawn frames is that of all, since one clock draws them."""

    clip_sha256: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")]
    frames_drawn: Count
    frames_missing: Count


class ShownClips(BaseModel):
    """The clips of a trial by their roles; those that its kind does not show are left out."""

    # An unknown role would otherwise vanish without a trace.
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


# Only measured parts of the answer: a value that the participant chose is never made unknown.
_MEASURED: dict[Path, Any] = {
    **{(name,): None for name in ("rt", "rt_from_first_frame", "time_elapsed", "answered_at_client")},
    ("changes",): LEFT_OUT,
    **{
        ("playback", name): None
        for name in PlaybackLog.model_fields
        # Faults of the first two are the page's; disturbances are repaired key by key, below.
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
    # Without a playback the answer is refused anyway, when it is validated again.
    if isinstance(playback, dict):
        told = playback.get("disturbances")
        playback["disturbances"] = {**(told if isinstance(told, dict) else {}), IMPOSSIBLE: len(unknown)}


# Decision 0501: An answer is a union over the kinds.
class RatingIn(BaseModel):
    """One play of one trial with its answer, whose `kind` is that of the study's trials."""

    trial_index: Count
    play: Annotated[int, Field(ge=1, le=100)] = 1
    answer: AnyAnswer
    rt: Milliseconds | None = Field(default=None, description="From the clip's last frame to the answer, ms.")
    rt_from_first_frame: Milliseconds | None = None
    time_elapsed: Milliseconds | None = Field(
        default=None, description="Time the run's page was open before the answer, ms."
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
        return validate_measured(data, handler, _MEASURED, _count_unknown)


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
        # `type` and not `isinstance`: true and false are integers to Python.
        if not self.path.startswith(RATINGS) or type(trial_index) is not int or type(play) is not int:
            return None
        # The bounds of `Count` and of a play above: the record was never validated.
        return (trial_index, play) if 0 <= trial_index <= 1_000_000 and 1 <= play <= 100 else None


class TrialClip(BaseModel):
    """One clip of a trial, and the role in which it is shown; it is at `/clips/{clip_sha256}.mp4`.

    Every clip of a trial is shown at the size of the first, which is given with the trial.
    """

    role: Role
    clip_sha256: str
    frames: int
    fps: float


class SeriesPosition(BaseModel):
    """Where a trial is in an adaptive series, and how much of it the choice of its clip knew."""

    number: int = Field(description="Which series, from 0.")
    position: int = Field(description="Position in the series, from 1.")
    known: int = Field(
        description="Answers of the series that the choice rests on; sent back with the answer."
    )


class TrialInfo(BaseModel):
    """One trial as the page needs it; nothing reveals to the participant which cell it is."""

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
    # The page needs the kind to know which question to show.
    check: CheckName | None = Field(
        default=None, description="What kind of motion check it is; its answer is never sent."
    )
    plays_done: int
    plays_wanted: int
    answered: bool
    views_begun: int = Field(description="The highest number of a view of this trial; 0 where it has none.")
    views: list[ViewState] = Field(description="Views that still wait for the answer of their play.")
    series: SeriesPosition | None = Field(default=None, description="Of trials that answers decide on.")


class WarningShown(BaseModel):
    """A friendly warning to a participant who answers carelessly; the page shows it before the next trial."""

    rule: str = Field(description="The rule of [[warnings.rules]] that the latest answers break.")
    number: int = Field(description="Which warning of this run it is, from 1.")
    maximum: int = Field(description="How many there are.")
    text: str = Field(description="Markdown, in the participant's language.")


class Receipt(BaseModel):
    """The rating is on disk."""

    rating_id: str
    saved_at: datetime
    verdict: Literal["good", "uncertain", "flagged", "failed"]
    rule: str = Field(description="The rule that determined the verdict; empty if good.")
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
