"""A participant's visit: the run, its trials in stored order, ratings, events, forms and calibrations."""

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, ForeignKey, ForeignKeyConstraint, Index, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from server.clock import now
from server.models.base import Base, one_of
from server.models.studies import Link, Study, StudyVersion

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
CLIP_ROLES = ("shown", "left", "right", "first", "second", "reference")
NO_SLOT = -1
RUN_STATUSES = ("active", "complete", "screened_out", "withdrawn")


class StudyRun(Base):
    """A participant's visit. No internet address is stored, here or anywhere.

    participant: the study's pseudonym of the person, see `server.participants.identities`.
    slot: place in the counterbalancing, held while the run is complete, or active and seen within the lease;
    NO_SLOT while an answer of a form is still to decide the group, and once a run that one decided is erased.
    group_name: empty without groups, and in such an erased run.
    origin: where its answers come from, given at its start; the database refuses to change it.
    seed: of the trial order. trials_answered: trials that need no further play, practice and checks included.
    elapsed_ms: latest `time_elapsed`, from which the clock goes on after a reload.
    px_per_mm, viewing_distance_mm: of the latest calibration, copied to each rating.
    evidence: asked where the page brings evidence with each answer, older where it was open before pages did,
    none where the run is older itself or not a person's. evidence_verdict: judged at completion.
    erased_at: the person's data were deleted on request; the row stays so that counts stay right.
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
    evidence: Mapped[str] = mapped_column(String(5), default="none")
    evidence_verdict: Mapped[str | None] = mapped_column(String(10))

    study: Mapped[Study] = relationship()
    version: Mapped[StudyVersion] = relationship()
    link: Mapped[Link] = relationship()


class RecruiterIdentity(Base):
    """Who a run's person is to the recruiter: the only place where such an id is stored.

    identifier: the person's id, empty where the address named nobody. parameters: of the address.
    """

    __tablename__ = "recruiter_identities"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    identifier: Mapped[str] = mapped_column(String(500), default="")
    parameters: Mapped[dict[str, str]] = mapped_column(default=dict)


class AssignedTrial(Base):
    """One trial of a run in its stored order. Attention checks have no clips, but an expected response.

    Of a motion check `expected_response` is the right answer, which no participant is sent.
    """

    __tablename__ = "assigned_trials"
    __table_args__ = (one_of("kind", "practice", "main", "attention", "check"),)

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(10))
    block: Mapped[int]
    block_label: Mapped[str] = mapped_column(String(60))
    expected_response: Mapped[int | None]


class TrialClip(Base):
    """A clip of a trial and the role it is shown in. position: in the order of the trial's clips, from 0."""

    __tablename__ = "trial_clips"
    __table_args__ = (
        one_of("role", *CLIP_ROLES),
        ForeignKeyConstraint(
            ["study_run_id", "trial_index"],
            ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
            ondelete="CASCADE",
        ),
        {"sqlite_with_rowid": False},
    )

    study_run_id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    role: Mapped[str] = mapped_column(String(10), primary_key=True)
    position: Mapped[int]
    version_clip_id: Mapped[int] = mapped_column(ForeignKey("version_clips.id"))


class Rating(Base):
    """One play of one trial with its answer. The view of its kind shows it with everything around it.

    rating_id: made by the client, so that sending it again stores it once.
    kind: of the trial, as declared. payload: the kind's answer (`experiments.trials.<kind>.answer`).
    playback: of each clip by its role, where a trial shows several; the columns then sum it up.
    disturbances: how often each disturbed the views of this play; null where the page did not watch.
    drawn: [frame index, time in ms] of every drawn frame of a trial's one clip.
    """

    __tablename__ = "trial_ratings"
    __table_args__ = (
        UniqueConstraint("study_run_id", "trial_index", "play"),
        UniqueConstraint("study_run_id", "rating_id"),
        ForeignKeyConstraint(
            ["study_run_id", "trial_index"],
            ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
            ondelete="CASCADE",
        ),
        one_of("method", "webcodecs", "video", "none"),
        one_of("verdict", "good", "uncertain", "flagged", "failed"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    rating_id: Mapped[str] = mapped_column(String(40))
    study_run_id: Mapped[int]
    trial_index: Mapped[int]
    play: Mapped[int]
    kind: Mapped[str] = mapped_column(String(40), default="clip_rating")
    payload: Mapped[dict[str, Any]]
    playback: Mapped[dict[str, Any] | None]
    rt: Mapped[float | None]
    rt_from_first_frame: Mapped[float | None]
    time_elapsed: Mapped[float | None]
    changes: Mapped[int] = mapped_column(default=0)
    comment: Mapped[str | None] = mapped_column(Text)
    answered_at_client: Mapped[datetime | None]
    method: Mapped[str] = mapped_column(String(10))
    clip_sha256: Mapped[str | None] = mapped_column(String(64))
    key_to_first_frame_ms: Mapped[float | None]
    frames_drawn: Mapped[int | None]
    frames_late: Mapped[int | None]
    frames_missing: Mapped[int | None]
    longest_gap_ms: Mapped[float | None]
    clock_gap_ms: Mapped[float | None]
    clock_late_ms: Mapped[float | None]
    stalls: Mapped[int | None]
    focus_lost: Mapped[bool | None]
    refresh_rate_hz: Mapped[float | None]
    device_pixel_ratio: Mapped[float | None]
    px_per_mm: Mapped[float | None]
    viewing_distance_mm: Mapped[float | None]
    verdict: Mapped[str] = mapped_column(String(10))
    verdict_rule: Mapped[str] = mapped_column(String(40), default="")
    drawn: Mapped[list[list[float]] | None]
    disturbances: Mapped[dict[str, int] | None]
    saved_at: Mapped[datetime] = mapped_column(default=now)


class View(Base):
    """One view of a trial's clips, stored when it begins; it stays open where the page dies before its end.

    view_id: made by the client. number: of the trial's views, from 1. play: the play it is part of.
    screen: its state at the start. outcome: null until it has ended, or where an older page does not tell.
    showings: what was measured of each clip, or clips at once, in order; the frames are with the clips.
    disturbances: how often each disturbed this view.
    """

    __tablename__ = "views"
    __table_args__ = (
        UniqueConstraint("study_run_id", "view_id"),
        UniqueConstraint("study_run_id", "trial_index", "number"),
        one_of("outcome", "shown", "interrupted"),
        ForeignKeyConstraint(
            ["study_run_id", "trial_index"],
            ["assigned_trials.study_run_id", "assigned_trials.trial_index"],
            ondelete="CASCADE",
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    view_id: Mapped[str] = mapped_column(String(40))
    study_run_id: Mapped[int]
    trial_index: Mapped[int]
    number: Mapped[int]
    play: Mapped[int]
    started_at_client: Mapped[datetime]
    received_at: Mapped[datetime] = mapped_column(default=now)
    ended_at_client: Mapped[datetime | None]
    completed: Mapped[bool] = mapped_column(default=False)
    outcome: Mapped[str | None] = mapped_column(String(12))
    screen: Mapped[dict[str, Any]] = mapped_column(default=dict)
    showings: Mapped[list[dict[str, Any]] | None]
    disturbances: Mapped[dict[str, int]] = mapped_column(default=dict)


class ViewClip(Base):
    """One clip in one view. frame_log: what was drawn when, as `server.views.frame_log` packs it."""

    __tablename__ = "view_clips"
    __table_args__ = (one_of("role", *CLIP_ROLES),)

    view: Mapped[int] = mapped_column(
        ForeignKey("views.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    role: Mapped[str] = mapped_column(String(10), primary_key=True)
    clip_sha256: Mapped[str] = mapped_column(String(64))
    frame_log: Mapped[str] = mapped_column(Text)


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

    occasion: why it was made. repeats, spread_percent: how many measurements there were, how well they agree.
    ruler_check: what a ruler said of a card's size. distance_spread_mm: standard deviation of the blind-spot
    rounds. recheck_percent: how far a look in mid-run was off.
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
