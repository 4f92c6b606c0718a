"""A run's trials in stored order, the clips of each, and the plays with their ratings."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, ForeignKeyConstraint, Index, String, Text, UniqueConstraint, literal_column
from sqlalchemy.orm import Mapped, mapped_column

from server.clock import now
from server.models.base import Base, one_of

CLIP_ROLES = ("shown", "left", "right", "first", "second", "reference")


class AssignedTrial(Base):
    """One trial of a run in its stored order. Attention checks have no clips, but an expected response.

    Of a motion check `expected_response` is the right answer, which no participant is sent.
    """

    __tablename__ = "assigned_trials"
    __table_args__ = (
        one_of("kind", "practice", "main", "attention", "check"),
        # Few trials of many: what counts answers to checks reads these alone.
        Index(
            "ix_assigned_trials_not_main",
            "study_run_id",
            "kind",
            "trial_index",
            sqlite_where=literal_column("kind <> 'main'"),
            postgresql_where=literal_column("kind <> 'main'"),
        ),
    )

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    kind: Mapped[str] = mapped_column(String(10))
    block: Mapped[int]
    block_label: Mapped[str] = mapped_column(String(60))
    expected_response: Mapped[int | None]


class TrialClip(Base):
    """A clip of a trial and the role it is shown in.

    Attributes
    ----------
    position : int
        In the order of the trial's clips, from 0.
    """

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

    Attributes
    ----------
    rating_id : str
        Made by the client, so that sending it again stores it once.
    kind : str
        Of the trial, as declared.
    payload : dict of str to Any
        The kind's answer (`experiments.trials.<kind>.answer`).
    playback : dict of str to Any or None
        Of each clip by its role, where a trial shows several; the columns then sum it up.
    disturbances : dict of str to int or None
        How often each disturbed the views of this play; null where the page did not watch.
    drawn : list of list of float or None
        [frame index, time in ms] of every drawn frame of a trial's one clip.
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
