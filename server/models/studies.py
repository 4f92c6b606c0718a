"""Studies, their versions, clips and links; the visits of participants, with events, forms and counts."""

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, ForeignKey, Index, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.core.values import new_pseudonym_key, now
from server.models.base import Base, one_of

# Studies, their versions, clips and links.


class Study(Base):
    """A study on this server. What is declared lies in its versions; new runs use `active_version`.

    Attributes
    ----------
    status : str
        Draft (only previews), pilot, live, closed.
    paused : bool
        No new runs for the moment.
    quota : int or None
        Complete runs after which the study closes itself.
    revision : int
        Counts edits, so that of two people editing at once the second is warned.
    recruiter : dict of str to Any or None
        See `server.participation.recruiter`.
    archived_at : datetime or None
        Since when it is out of the list of studies; it can be read, and not changed.
    pseudonym_key : str
        What the names of its participants are made with; it never leaves the database.
    workspace_id : int or None
        The laboratory it belongs to; a study of none is open to nobody but the command line.
    """

    __tablename__ = "studies"
    __table_args__ = (one_of("status", "draft", "pilot", "live", "closed"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    title: Mapped[str] = mapped_column(String(300))
    status: Mapped[str] = mapped_column(String(10), default="draft")
    paused: Mapped[bool] = mapped_column(default=False)
    active_version: Mapped[int] = mapped_column(default=1)
    quota: Mapped[int | None]
    recruiter: Mapped[dict[str, Any] | None]
    revision: Mapped[int] = mapped_column(default=1)
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    opened_at: Mapped[datetime | None]
    closed_at: Mapped[datetime | None]
    archived_at: Mapped[datetime | None]
    pseudonym_key: Mapped[str] = mapped_column(String(64), default=new_pseudonym_key)
    workspace_id: Mapped[int | None] = mapped_column(ForeignKey("workspaces.id"), index=True)

    versions: Mapped[list["StudyVersion"]] = relationship(
        back_populates="study", order_by="StudyVersion.number", cascade="all, delete-orphan"
    )


class StudyVersion(Base):
    """One frozen declaration of a study with the manifest of its clips; never changed once a run uses it.

    Attributes
    ----------
    format : int
        Of the stored definition.
    series : int
        Versions of a study that measure the same have the same number; only their answers may be pooled.
    """

    __tablename__ = "study_versions"
    __table_args__ = (UniqueConstraint("study_id", "number"), {"sqlite_autoincrement": True})

    id: Mapped[int] = mapped_column(primary_key=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"))
    number: Mapped[int]
    experiment: Mapped[str] = mapped_column(String(60))
    definition_toml: Mapped[str] = mapped_column(Text)
    definition: Mapped[dict[str, Any]]
    definition_sha256: Mapped[str] = mapped_column(String(64))
    manifest: Mapped[dict[str, Any]]
    inter_ocular_px: Mapped[float | None]
    note: Mapped[str] = mapped_column(Text, default="")
    format: Mapped[int] = mapped_column(default=1)
    series: Mapped[int] = mapped_column(default=1)
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))

    study: Mapped[Study] = relationship(back_populates="versions")
    clips: Mapped[list["VersionClip"]] = relationship(
        back_populates="version", order_by="VersionClip.id", cascade="all, delete-orphan"
    )


class Clip(Base):
    """The bytes of a clip in the clip store, by their SHA-256; studies share clips."""

    __tablename__ = "clips"

    sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    bytes: Mapped[int]
    fps: Mapped[float]
    frames: Mapped[int]
    width_px: Mapped[int]
    height_px: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(default=now)


class BuilderDraft(Base):
    """One tab in which somebody has the builder of a study open, and the unsaved work there.

    Attributes
    ----------
    tab : str
        A name that the page makes up.
    seen_at : datetime
        When the page was last heard of; soon after, it counts as closed.
    draft : dict of str to Any or None
        The unsaved work as the page writes it; None where there is none.
    """

    __tablename__ = "builder_drafts"

    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"), primary_key=True)
    account_id: Mapped[int] = mapped_column(
        ForeignKey("accounts.id", ondelete="CASCADE"), primary_key=True, index=True
    )
    tab: Mapped[str] = mapped_column(String(40), primary_key=True)
    seen_at: Mapped[datetime] = mapped_column(default=now)
    draft: Mapped[dict[str, Any] | None]
    saved_at: Mapped[datetime | None]


class VersionClip(Base):
    """A clip's place in a study version: its cell, levels and exemplar.

    The clips of motion checks have no cell (`CHECK_CELL`); their level is `check`, their exemplar its number.

    Attributes
    ----------
    blinks_s : list of float or None
        Onsets of the blinks of a performance in s; None for other clips.
    """

    __tablename__ = "version_clips"
    __table_args__ = (UniqueConstraint("version_id", "cell", "exemplar"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    version_id: Mapped[int] = mapped_column(ForeignKey("study_versions.id", ondelete="CASCADE"))
    clip_sha256: Mapped[str] = mapped_column(ForeignKey("clips.sha256"), index=True)
    cell: Mapped[str] = mapped_column(Text)
    levels: Mapped[dict[str, str]]
    exemplar: Mapped[int]
    profile_id: Mapped[str] = mapped_column(String(200), default="")
    file: Mapped[str] = mapped_column(String(200))
    width_mm: Mapped[float | None]
    blinks_s: Mapped[list[float] | None]

    version: Mapped[StudyVersion] = relationship(back_populates="clips")
    clip: Mapped[Clip] = relationship()


class Link(Base):
    """A way in. The token itself is derived from the secret key and `public_id`; only its hash is stored.

    Attributes
    ----------
    kind : str
        General (any number of people), personal (one person, resumes on any device), preview (nothing is
        counted or exported).
    label : str
        Who or what it is for.
    synthetic : bool
        Its runs are simulated, not people.
    group_name : str
        The group its participants come into, where links decide; else empty.
    """

    __tablename__ = "links"
    __table_args__ = (
        one_of("kind", "general", "personal", "preview"),
        Index("ix_links_study_id_kind", "study_id", "kind"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    public_id: Mapped[str] = mapped_column(String(32), unique=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id", ondelete="CASCADE"))
    kind: Mapped[str] = mapped_column(String(10))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    label: Mapped[str] = mapped_column(String(200), default="")
    synthetic: Mapped[bool] = mapped_column(default=False)
    group_name: Mapped[str] = mapped_column(Text, default="")
    quota: Mapped[int | None]
    recruiter: Mapped[dict[str, Any] | None]
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))

    study: Mapped[Study] = relationship()


# A participant's visit: the run, and its identity at the recruiter.

STAGES = (
    "consent",
    "forms_before",
    "calibration",
    "instructions",
    "practice",
    "trials",
    "forms_after",
    "debrief",
    "done",
)
ORIGINS = ("participant", "preview", "pilot", "simulated")
NO_SLOT = -1
RUN_STATUSES = ("active", "complete", "screened_out", "withdrawn")


# Decision 0330: Every run has an origin, every version a data series.
class StudyRun(Base):
    """A participant's visit. No internet address is stored, here or anywhere.

    Attributes
    ----------
    participant : str
        The study's pseudonym of the person, see `server.participation.returning`.
    slot : int
        Place in the counterbalancing, held while the run is complete, or active and seen within the lease;
        NO_SLOT while an answer of a form is still to decide the group, and once a run that one decided is
        erased.
    group_name : str
        Empty without groups, and in such an erased run.
    origin : str
        Where its answers come from, given at its start; the database refuses to change it.
    seed : int
        Of the trial order.
    trials_answered : int
        Trials that need no further play, practice and checks included.
    elapsed_ms : float
        Latest `time_elapsed`, from which the clock goes on after a reload.
    px_per_mm, viewing_distance_mm : float or None
        Of the latest calibration, copied to each rating.
    recruiter : str or None
        Kind of the recruiter whose id the address named at the start; empty where it named nobody, None in
        runs from before this was stored.
    evidence : str
        `asked` where the page brings evidence with each answer, `older` where it was open before pages did,
        `none` where the run is older itself or not a person's.
    evidence_verdict : str or None
        Judged at completion.
    view_tickets : bool
        Its page brings a ticket with each view, too.
    erased_at : datetime or None
        The person's data were deleted on request; the row stays so that counts stay right.
    """

    __tablename__ = "study_runs"
    __table_args__ = (
        one_of("phase", "pilot", "live"),
        one_of("origin", *ORIGINS),
        one_of("status", *RUN_STATUSES),
        one_of("stage", *STAGES),
        one_of("evidence", "none", "older", "asked"),
        UniqueConstraint("link_id", "client_id"),
        Index("ix_study_runs_study_id_status", "study_id", "status"),
        Index("ix_study_runs_version_id_slot", "version_id", "slot"),
        Index("ix_study_runs_study_id_id", "study_id", "id"),
        Index(
            "ix_study_runs_study_id_origin_status", "study_id", "origin", "status", "stage", "completed_at"
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    public_id: Mapped[str] = mapped_column(String(32), unique=True)
    study_id: Mapped[int] = mapped_column(ForeignKey("studies.id"))
    version_id: Mapped[int] = mapped_column(ForeignKey("study_versions.id"))
    link_id: Mapped[int] = mapped_column(ForeignKey("links.id"))
    client_id: Mapped[str] = mapped_column(String(80))
    token_hash: Mapped[str] = mapped_column(String(64), unique=True)
    participant: Mapped[str] = mapped_column(String(200))
    phase: Mapped[str] = mapped_column(String(10))
    origin: Mapped[str] = mapped_column(String(12), default="participant")
    status: Mapped[str] = mapped_column(String(20), default="active")
    stage: Mapped[str] = mapped_column(String(20), default="consent")
    language: Mapped[str] = mapped_column(String(10))
    seed: Mapped[int] = mapped_column(BigInteger)
    slot: Mapped[int]
    group_name: Mapped[str] = mapped_column(Text, default="")
    trials_total: Mapped[int]
    trials_answered: Mapped[int] = mapped_column(default=0)
    started_at: Mapped[datetime] = mapped_column(default=now)
    last_seen_at: Mapped[datetime] = mapped_column(default=now)
    consented_at: Mapped[datetime | None]
    completed_at: Mapped[datetime | None]
    completion_code: Mapped[str] = mapped_column(String(100), default="")
    device: Mapped[dict[str, Any]] = mapped_column(default=dict)
    elapsed_ms: Mapped[float] = mapped_column(default=0.0)
    px_per_mm: Mapped[float | None]
    viewing_distance_mm: Mapped[float | None]
    excluded: Mapped[bool] = mapped_column(default=False)
    exclusion_reason: Mapped[str | None] = mapped_column(Text)
    excluded_at: Mapped[datetime | None]
    excluded_by: Mapped[int | None] = mapped_column(ForeignKey("accounts.id", ondelete="SET NULL"))
    erased_at: Mapped[datetime | None]
    recruiter: Mapped[str | None] = mapped_column(String(10))
    evidence: Mapped[str] = mapped_column(String(5), default="none")
    evidence_verdict: Mapped[str | None] = mapped_column(String(10))
    view_tickets: Mapped[bool] = mapped_column(default=False)

    study: Mapped[Study] = relationship()
    version: Mapped[StudyVersion] = relationship()
    link: Mapped[Link] = relationship()


# Decision 0530: Participants have pseudonyms, and an id opens no visit.
class RecruiterIdentity(Base):
    """Who a run's person is to the recruiter, encrypted.

    Read and written by `server.participation.identity_repository`.

    Attributes
    ----------
    identifier_hash : str
        Keyed hash of the person's id, by which visits of one person are known; empty where the address named
        nobody.
    sealed : str
        Id and parameters of the address, under the run's key (`IdentityKey`); empty once the key is erased.
    """

    __tablename__ = "recruiter_identities"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    identifier_hash: Mapped[str] = mapped_column(String(64), default="", index=True)
    sealed: Mapped[str] = mapped_column(Text)


class IdentityKey(Base):
    """The key of what `RecruiterIdentity` holds, wrapped. No backup has it: its erasure reaches them all."""

    __tablename__ = "identity_keys"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    wrapped_key: Mapped[str] = mapped_column(String(80))


# What a visit leaves in addition to its ratings: events, answers to forms, measurements of the screen.


class RunEvent(Base):
    """What happened around a run (or before one: `link_id` only, where a browser was refused)."""

    __tablename__ = "run_events"
    __table_args__ = (UniqueConstraint("study_run_id", "event_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    event_id: Mapped[str] = mapped_column(String(40))
    study_run_id: Mapped[int | None] = mapped_column(ForeignKey("study_runs.id", ondelete="CASCADE"))
    link_id: Mapped[int | None] = mapped_column(ForeignKey("links.id", ondelete="CASCADE"), index=True)
    type: Mapped[str] = mapped_column(String(30))
    at_client: Mapped[datetime | None]
    received_at: Mapped[datetime] = mapped_column(default=now)
    data: Mapped[dict[str, Any]] = mapped_column(default=dict)


class FormAnswer(Base):
    """The answers of one declared form; the latest version a participant sent."""

    __tablename__ = "form_answers"
    __table_args__ = (UniqueConstraint("study_run_id", "form"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    study_run_id: Mapped[int] = mapped_column(ForeignKey("study_runs.id", ondelete="CASCADE"))
    form: Mapped[str] = mapped_column(String(40))
    answers: Mapped[dict[str, Any]]
    saved_at: Mapped[datetime] = mapped_column(default=now)


class Calibration(Base):
    """One size calibration of a run; every one is kept, the latest counts.

    Attributes
    ----------
    occasion : str
        Why it was made.
    repeats, spread_percent : int or None, float or None
        How many measurements there were, how well they agree.
    ruler_check : str or None
        What a ruler said of a card's size.
    distance_spread_mm : float or None
        Standard deviation of the blind-spot rounds.
    recheck_percent : float or None
        How far a look in mid-run was off.
    """

    __tablename__ = "calibrations"
    __table_args__ = (
        one_of("method", "card", "ruler"),
        one_of("occasion", "first", "screen_changed", "zoom", "recheck"),
        one_of("ruler_check", "agrees", "no_ruler", "differs"),
        one_of("distance_method", "blind_spot", "typed"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    study_run_id: Mapped[int] = mapped_column(ForeignKey("study_runs.id", ondelete="CASCADE"), index=True)
    px_per_mm: Mapped[float]
    method: Mapped[str] = mapped_column(String(10))
    viewing_distance_mm: Mapped[float | None]
    device_pixel_ratio: Mapped[float]
    screen_width_px: Mapped[int]
    screen_height_px: Mapped[int]
    window_width_px: Mapped[int]
    window_height_px: Mapped[int]
    zoom: Mapped[float]
    saved_at: Mapped[datetime] = mapped_column(default=now)
    occasion: Mapped[str] = mapped_column(String(14), default="first", server_default="first")
    repeats: Mapped[int | None]
    spread_percent: Mapped[float | None]
    ruler_check: Mapped[str | None] = mapped_column(String(10))
    distance_method: Mapped[str | None] = mapped_column(String(10))
    distance_spread_mm: Mapped[float | None]
    distance_typed_mm: Mapped[float | None]
    recheck_percent: Mapped[float | None]


# What was counted of each run, kept in the transaction of each rating.


# Decision 0540: One tally per run, updated with each rating.
class RunTally(Base):
    """The counts of one run; `server.participation.tallies` reads and writes the two texts.

    Attributes
    ----------
    heat : str
        One letter per trial.
    not_good : int
        Plays that were flagged or failed.
    counts : str
        Of plays, times and cells, as JSON.
    answers : str
        Packed, by scale, as JSON.
    clip_ms, newest_clip_ms : float
        Of the answers' evidence, in ms: `server.participation.clip_hashes.ClipTime`.
    first_issued_at, newest_issued_at, last_received_at : datetime or None
        Of the same.
    """

    __tablename__ = "run_tallies"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    heat: Mapped[str] = mapped_column(Text)
    not_good: Mapped[int]
    counts: Mapped[str] = mapped_column(Text)
    answers: Mapped[str] = mapped_column(Text)
    clip_ms: Mapped[float] = mapped_column(default=0.0)
    newest_clip_ms: Mapped[float] = mapped_column(default=0.0)
    first_issued_at: Mapped[datetime | None]
    newest_issued_at: Mapped[datetime | None]
    last_received_at: Mapped[datetime | None]
