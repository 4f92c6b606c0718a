"""What the endpoints of studies, definitions, clips and links take and give."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from experiments.declaration.experiment import Experiment
from experiments.manifest import FrameRate, Sha256, SourceVideo
from server.core.values import Number, RequestBody
from server.models import Right
from server.participation.recruiter import Recruiter, without_refused

# Fields that several bodies of the study endpoints have.

StudyName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$")]
TomlText = Annotated[str, StringConstraints(max_length=500_000)]
Label = Annotated[str, StringConstraints(strip_whitespace=True, max_length=200)]
Revision = Annotated[int, Field(ge=1, le=2**31 - 1, description="The revision this edit started from.")]


# What the endpoints of definitions take and give: texts, their problems, what they expand to, edits.


class DefinitionText(RequestBody):
    """A definition to check."""

    toml: TomlText


class ProblemOut(BaseModel):
    """One thing wrong in a definition."""

    line: int | None
    path: str
    message: str


class BlockOut(BaseModel):
    """A block of the design."""

    label: str
    trials: int


class LevelOut(BaseModel):
    """A level of a factor."""

    name: str
    label: str


class FactorOut(BaseModel):
    """A factor and its levels."""

    name: str
    label: str
    levels: list[LevelOut]


class DesignOut(BaseModel):
    """What a definition expands to."""

    experiment: str
    title: str
    factors: list[FactorOut]
    cells: int
    exemplars: int
    unique_clips: int
    trials_per_participant: int
    blocks: list[BlockOut]
    expected_minutes: float
    notes: list[str] = Field(description="Groups, and how often each clip or pair is expected to be shown.")
    groups: list[str] = Field(description="Groups that links decide; empty where they decide none.")
    turned_away: str = Field(description="Devices that can take no part, in a sentence; empty where all can.")


class DefinitionCheck(BaseModel):
    """Whether a definition can be used, and what it expands to."""

    problems: list[ProblemOut]
    design: DesignOut | None


class ChangeOut(BaseModel):
    """One key of a definition that an edit changes."""

    path: str
    effect: Literal["wording", "measured"]
    text: str = Field(description="The change in words.")


class JudgedEdit(BaseModel):
    """What saving an edited definition would do to the answers that are stored."""

    changes: list[ChangeOut]
    series: int = Field(description="Data series that answers to the edited definition would be of.")
    present_series: int
    runs: int = Field(description="Runs of the present series, previews aside.")
    begins_series: bool = Field(
        description="A new data series begins, and there are runs it is kept apart from."
    )


class EditDefinition(RequestBody):
    """A definition's text, and what it shall say instead; without `data` the text is read only."""

    toml: TomlText
    data: dict[str, Any] | None = Field(default=None, description="The declaration as the TOML's tables.")


class EditedDefinition(BaseModel):
    """A definition as text and as data, with its problems, or what it expands to."""

    toml: str
    comments: list[str] = Field(description="Comments in the text, from top to bottom.")
    data: dict[str, Any] | None = Field(description="Null where the text is not TOML.")
    problems: list[ProblemOut]
    design: DesignOut | None


# What the endpoints of clips take and give: uploads, levels of own clips, the clips of a study.


class LevelsTable(RequestBody):
    """A CSV with one row per clip: column `file`, then one column per factor; `exemplar` is optional."""

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


# What the endpoints of studies take and give: new ones, versions, status and settings, the list.


class ShippedExperiment(BaseModel):
    """An experiment that comes with the program."""

    name: str
    title: str
    toml: str
    demonstration: bool = Field(description="True for those that are none of the paper's experiments.")
    clips_ready: bool = Field(description="True where `stimuli build` has made its clips on this server.")


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


class PlacedClip(RequestBody):
    """A clip of the study or of an upload, and the cell it belongs to."""

    clip_sha256: Sha256
    file: Annotated[str, StringConstraints(max_length=300)]
    levels: dict[str, str]
    exemplar: Annotated[int, Field(ge=1, le=10_000)]


Places = Annotated[
    list[PlacedClip] | None,
    Field(max_length=5000, description="Every clip with its cell; null leaves clips where they are."),
]


class EditedVersion(DefinitionText):
    """A changed definition, and clips in other cells, to be judged before they are saved."""

    places: Places = None


class NewVersion(EditedVersion):
    """A changed definition; it becomes a new version."""

    revision: Revision
    note: Label = ""
    upload: str | None = Field(default=None, description="Clips to add, or to put in the place of others.")
    levels: LevelsTable | LevelsPattern | None = Field(
        default=None, description="Cells of the uploaded clips; not needed with `places`."
    )


# What the endpoints of the builder's drafts take and give.

Tab = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9-]{1,40}$")]


class BuilderWork(RequestBody):
    """Unsaved work of the builder."""

    toml: TomlText
    data: dict[str, Any] | None = Field(description="What the text shall say, if it does not yet.")
    revision: Revision
    base: TomlText | None = Field(description="The stored text that the work began from.")
    places: Annotated[list[dict[str, Any]], Field(max_length=5000)] | None = Field(
        description="Clips in other cells than stored."
    )


class DraftOut(BaseModel):
    """Unsaved work, and when it was kept."""

    tab: str
    at: datetime
    work: BuilderWork


class EditorOut(BaseModel):
    """Somebody else who has the builder of the study open, or oneself in another tab."""

    name: str
    own: bool
    edits: bool = Field(description="There is unsaved work.")


class ChangeStatus(RequestBody):
    """Open or close a study."""

    revision: Revision
    status: Literal["draft", "pilot", "live", "closed"]
    anyway: bool = Field(
        default=False,
        description="Set live although clips are missing or do not decode; the audit log notes it.",
    )


class ChangeSettings(RequestBody):
    """Pause, quota and recruiter."""

    revision: Revision
    paused: bool
    quota: Annotated[int, Field(ge=1, le=1_000_000)] | None
    recruiter: Recruiter | None


LaunchPage = Literal["build", "clips", "rehearsal", "links", "data", "settings", "preview", "server"]


class LaunchCheck(BaseModel):
    """Something to look at before a study goes live."""

    kind: str = Field(description="What was checked.")
    blocks: bool = Field(description="The study cannot go live like this.")
    text: str = Field(description="What was found and what to do, in a sentence.")
    page: LaunchPage = Field(description="The page on which it can be fixed.")
    path: str = Field(default="", description="The key of the declaration, or the part of the settings.")


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


class ListedStudy(StudySummary):
    """A study in the list, with who made it and what goes on in it."""

    owner: str = Field(description="Name of the account that created it; empty if it is gone.")
    last_activity: datetime = Field(description="When a participant was last seen, or a version was saved.")
    completed_by_day: list[int] = Field(
        description="Complete runs of each of the last 14 days (UTC), today last; previews left out."
    )


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
    rendered: bool = Field(description="Whether clips of the active version were rendered, not uploaded.")


# What the endpoints of a study's life cycle take and give: copies, the archive, comparisons.


class CloneStudy(RequestBody):
    """A copy of a study under another name."""

    name: StudyName
    version: Number | None = Field(
        default=None, description="The version to copy; the active one where none is given."
    )
    workspace: Annotated[str, StringConstraints(max_length=60)] | None = Field(
        default=None,
        description="Where the copy goes; required if the account may make no studies next to the source.",
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


# What the endpoints of links take and give, and how addresses are signed.


class Signing(BaseModel):
    """The study's secret for signed URLs, and how the recruiter's side signs with it."""

    declared: bool = Field(description="The recruiter declares that addresses are signed.")
    parameter: str = Field(description="Address parameter of the signature.")
    secret_name: str = Field(description="Another name makes another secret.")
    secret: str = Field(description="64 hexadecimal digits; who has it can sign for anybody.")
    identifier: str = Field(description="A participant's id, as an example.")
    signature: str = Field(description="HMAC-SHA-256 of that id, with the secret as key.")
    query: str = Field(
        description="What is added to the link after `?` for that participant, percent-encoded."
    )
    python: str = Field(description="The same signature in Python.")
    shell: str = Field(description="The same signature by OpenSSL.")


class NewLinks(RequestBody):
    """One general or preview link, or many personal ones: by their labels, or `count` numbered ones."""

    kind: Literal["general", "personal", "preview"]
    label: Label = ""
    group: Annotated[str, StringConstraints(max_length=600)] = Field(
        default="", description="Group of the people who come by it, where links decide."
    )
    labels: list[Label] = Field(default=[], max_length=5000)
    count: Annotated[int, Field(ge=1, le=5000)] = 1
    quota: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    days: Annotated[int, Field(ge=1, le=3650)] | None = None
    recruiter: Annotated[Recruiter, AfterValidator(without_refused)] | None = None


class LinkOut(BaseModel):
    """A link into a study."""

    id: str
    kind: str
    label: str
    group_name: str = Field(description="Group of the people who come by it; empty where links decide none.")
    url: str
    quota: int | None
    expires_at: datetime | None
    created_at: datetime
    runs: int
    complete: int
    recruiter: dict[str, Any] | None


class LinkPage(BaseModel):
    """Links in the order they were made."""

    links: list[LinkOut]
    total: int
    next: str | None = Field(description="Ask again with `after` = this; null at the end.")
