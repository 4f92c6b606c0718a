"""What the participant's page gets, and what it sends besides answers."""

from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import BaseModel, Field, StringConstraints

from experiments.checks import CheckName
from experiments.declaration.forms import Form
from experiments.declaration.tables import Display, Texts
from experiments.kinds import AnyPage
from experiments.rules import PlaybackRules
from server.models import STAGES
from server.participation.answer_schemas import RunStatus, Tickets, TrialInfo, WarningShown

# What the participant's page gets, and what begins a run; what it sends besides is below.

Stage = Literal[
    "consent",
    "forms_before",
    "calibration",
    "instructions",
    "practice",
    "trials",
    "forms_after",
    "debrief",
    "done",
]
# A literal type must be written out and cannot be made from the tuple.
if Stage.__args__ != STAGES:  # type: ignore[attr-defined]
    raise RuntimeError("the stages of the API and of the database differ")

Origin = Literal["participant", "preview", "pilot", "simulated"]
# Bounds keep a stranger from filling the database by a single request.
Text = Annotated[str, StringConstraints(max_length=500)]
Key = Annotated[str, StringConstraints(max_length=100)]
# A language, with a region where two of them differ (pt-BR).
LanguageTag = Annotated[str, StringConstraints(pattern=r"^[a-z]{2}(-[A-Z]{2})?$")]


# Decision 0340: Pages get their own models; TypeScript types are generated.
class Gates(BaseModel):
    """What the device must offer before a run begins."""

    minimum_width_px: int
    minimum_height_px: int
    allow_touch: bool
    full_screen: bool
    calibrate: Literal["required", "optional", "off"]
    viewing_distance: bool
    inter_ocular_mm: float


class LinkedStudy(BaseModel):
    """What a visitor may know of a study before the run begins."""

    name: str
    title: str = Field(description="What participants read, in the study's first language.")
    titles: dict[str, str] = Field(description="The same in every language of the study.")
    languages: list[str]
    background: str
    expected_minutes: float


class LinkState(BaseModel):
    """Where a link leads, and whether it is open."""

    study: LinkedStudy
    status: Literal["open", "closed", "expired", "full", "paused", "used"]
    kind: Literal["general", "personal", "preview"]
    resumable: bool = Field(description="A run of this personal link is under way and can be taken up again.")
    screens_devices: bool = Field(description="A closed gate ends the visit as screened out.")
    way_back: str | None = Field(
        description="The recruiter's address for people who take no part, {address parameters} not filled in."
    )
    gates: Gates


class RunStart(BaseModel):
    """Begin (or take up) a run. The same client_id gets the same run, however often it asks."""

    language: LanguageTag
    client_id: UUID
    evidence: bool = Field(default=False, description="The page brings evidence with each answer.")
    view_tickets: bool = Field(default=False, description="It brings a ticket with each view, too.")
    # Stored as it comes: a recruiter's names of parameters are not known in advance.
    query: dict[Key, Text] = Field(
        default_factory=dict, max_length=20, description="Parameters of the address, such as PROLIFIC_PID."
    )
    device: dict[Key, Any] = Field(default_factory=dict, max_length=40)
    resume_code: Annotated[str, StringConstraints(max_length=60)] | None = Field(
        default=None, description="Code that the page has shown: takes up that visit in this browser."
    )
    anew: bool = Field(
        default=False,
        description="Begin a visit though one under the same recruiter's ID is open in another browser.",
    )


class RunStarted(BaseModel):
    """The token that stands for the run from now on."""

    run_token: str
    run_id: str
    resumed: bool


class BlockInfo(BaseModel):
    """One block: its number (0 is practice) and how many trials it has."""

    block: int
    trials: int


Occasion = Literal["first", "screen_changed", "zoom", "recheck"]
RulerCheck = Literal["agrees", "no_ruler", "differs"]
DistanceMethod = Literal["blind_spot", "typed"]


class CalibrationState(BaseModel):
    """The latest calibration."""

    px_per_mm: float
    method: Literal["card", "ruler"]
    viewing_distance_mm: float | None
    device_pixel_ratio: float
    screen_width_px: int
    screen_height_px: int
    window_width_px: int
    window_height_px: int
    zoom: float
    occasion: Occasion
    repeats: int | None
    spread_percent: float | None
    ruler_check: RulerCheck | None
    distance_method: DistanceMethod | None
    distance_spread_mm: float | None
    distance_typed_mm: float | None
    recheck_percent: float | None


class ShownCheck(BaseModel):
    """The question about the clips of one kind of motion check; answers are numbered from 1."""

    question: str
    choices: list[str]


class ShownOtherWay(BaseModel):
    """The way around motion checks: its button, and the Markdown behind it."""

    label: str
    text: str


class ShownChecks(BaseModel):
    """The motion checks of a study as the page gets them, in the run's language."""

    by_kind: dict[CheckName, ShownCheck]
    other_way: ShownOtherWay | None


class RunState(BaseModel):
    """Everything the page needs to begin or to go on."""

    run_id: str
    status: RunStatus
    stage: Stage
    origin: Origin = Field(description="Where the run's answers come from; given at its start.")
    language: str
    languages: list[str]
    texts: Texts = Field(description="Markdown of the run's language, by page.")
    forms: tuple[Form, ...]
    # By kind: each kind of trial declares what its page needs.
    trial: AnyPage
    display: Display
    playback: PlaybackRules
    break_seconds_min: int
    consented_at: datetime | None
    calibration: CalibrationState | None
    answered_forms: list[str]
    awaits_group: bool = Field(description="There are no trials yet: an answer of a form decides the group.")
    blocks: list[BlockInfo]
    trials: list[TrialInfo]
    checks: ShownChecks | None = Field(
        default=None, description="Words of the motion checks; null where there are none."
    )
    # The clock of the page starts again after a reload; this is added to it.
    elapsed_ms_before: float
    completion_code: str | None
    resumable_until: datetime | None = Field(
        description="Until when a reloaded page may go on without asking; null where it must ask."
    )
    resume_code: str | None = Field(
        description="By it the visit is taken up on another device; null where the link itself does that."
    )
    server_time: datetime
    # Null for pages that do not bring evidence, and after the end of a run.
    tickets: Tickets | None = Field(description="Leave to answer, a ticket for each play of each trial.")
    warning: WarningShown | None = Field(default=None, description="One that no page has shown yet.")


class Saved(BaseModel):
    """The server has it."""

    saved_at: datetime
    stage: Stage
    status: RunStatus
    run: "RunState | None" = Field(
        default=None, description="The whole run again, if this answer decided its group and trials."
    )


class Completion(BaseModel):
    """How the run ended, the code the participant takes away, and where to go."""

    status: Literal["complete", "screened_out"]
    completion_code: str | None
    redirect_url: str | None
    reason: str | None = Field(default=None, description="Why the run ended, if the page must say it.")


class Received(BaseModel):
    """The server has it."""

    received: int


# What the participant's page sends once a run has begun, or where none may begin.

EventType = Annotated[str, StringConstraints(pattern=r"^[a-z_]{1,30}$")]
# JSON has no infinity, but its parsers accept it.
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Percent = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
Millimetres = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
Pixels = Annotated[int, Field(ge=0, le=100_000)]


class Consent(BaseModel):
    """The participant's answer on the consent page; false ends the run."""

    agreed: bool


class CalibrationResult(BaseModel):
    """One size calibration; each is kept, the latest counts.

    Keys with a default were not sent by earlier pages.
    """

    # 200 px per mm is about 5000 dpi, ten times the finest phone.
    px_per_mm: Annotated[float, Field(gt=0, le=200, allow_inf_nan=False)]
    method: Literal["card", "ruler"]
    viewing_distance_mm: Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)] | None = None
    device_pixel_ratio: Positive
    screen_width_px: Pixels
    screen_height_px: Pixels
    window_width_px: Pixels
    window_height_px: Pixels
    zoom: Positive = 1.0
    occasion: Occasion = Field(default="first", description="Why it was made.")
    repeats: Annotated[int, Field(ge=1, le=100)] | None = Field(
        default=None, description="Measurements made, those included that differed too much."
    )
    spread_percent: Percent | None = Field(
        default=None, description="Largest less smallest of those that count, of their mean."
    )
    ruler_check: RulerCheck | None = Field(
        default=None, description="What a ruler said of the card's size; null where none was asked."
    )
    distance_method: DistanceMethod | None = None
    distance_spread_mm: Millimetres | None = Field(
        default=None, description="Standard deviation of the rounds of the blind-spot test."
    )
    distance_typed_mm: Millimetres | None = Field(
        default=None, description="The distance as it was typed in, where it was."
    )
    recheck_percent: Percent | None = Field(
        default=None, description="By how much a later measurement differed from the one before."
    )


class StageChange(BaseModel):
    """Where the participant is."""

    stage: Stage


class LanguageChange(BaseModel):
    """The language the participant reads from now on."""

    language: LanguageTag


class FormAnswers(BaseModel):
    """Answers by field name."""

    # Values are checked by the declaration of the form, which a schema cannot know.
    answers: dict[Key, Any] = Field(max_length=200)


class Event(BaseModel):
    """Something that happened in the page; `at` is the participant's clock."""

    id: UUID
    type: EventType
    # A clock of the participant may be wrong, so the server adds its own time of arrival.
    at: datetime | None = None
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)


class Events(BaseModel):
    """Up to 100 events; those the server already has are left as they are."""

    # A page that was offline sends its backlog in several requests.
    events: list[Event] = Field(max_length=100)


class Unsupported(BaseModel):
    """A browser or screen that failed a gate before a run began."""

    # There is no run yet, and so no run token.
    link_token: Annotated[str, StringConstraints(max_length=100)]
    reason: Key
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)


class ScreenOut(BaseModel):
    """Why the browser or the screen will not do."""

    reason: Key
    data: dict[Key, Any] = Field(default_factory=dict, max_length=50)
