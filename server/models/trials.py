"""A run's trials in stored order, their clips, views, ratings, evidence and adaptive series."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, ForeignKeyConstraint, Index, String, Text, UniqueConstraint, literal_column
from sqlalchemy.orm import Mapped, mapped_column

from server.core.values import now
from server.models.base import Base, one_of

# A run's trials in stored order, the clips of each, and the plays with their ratings.

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


# Decision 0332: Answers are payloads on the rating's row.
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
        The kind's answer (`experiments.kinds.<kind>.answer`).
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


# Each time that clips of a trial were shown, with the frames that were drawn.


# Decision 0331: Views are stored when they begin.
class View(Base):
    """One view of a trial's clips, stored when it begins; it stays open where the page dies before its end.

    Attributes
    ----------
    view_id : str
        Made by the client.
    number : int
        Of the trial's views, from 1.
    play : int
        The play it is part of.
    screen : dict of str to Any
        Its state at the start.
    outcome : str or None
        Null until it has ended, or if an older page does not report it.
    showings : list of dict of str to Any or None
        What was measured of each clip, or clips at once, in order; the frames are with the clips.
    disturbances : dict of str to int
        How often each disturbed this view.
    issued_at : datetime or None
        Of its ticket's batch, by the server's clock; null without one.
    clip_ms : float or None
        How long it lasts, where it was shown to its end: its clips at once, or in turn with what is between.
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
    issued_at: Mapped[datetime | None]
    clip_ms: Mapped[float | None]


class ViewClip(Base):
    """One clip in one view.

    Attributes
    ----------
    frame_log : str
        What was drawn when, as `server.participation.views` packs it.
    """

    __tablename__ = "view_clips"
    __table_args__ = (one_of("role", *CLIP_ROLES),)

    view: Mapped[int] = mapped_column(
        ForeignKey("views.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    role: Mapped[str] = mapped_column(String(10), primary_key=True)
    clip_sha256: Mapped[str] = mapped_column(String(64))
    frame_log: Mapped[str] = mapped_column(Text)


# What came with each answer to show how it came about.


class AnswerEvidence(Base):
    """The evidence of one answer: one play of one trial.

    Attributes
    ----------
    issued_at : datetime
        Of the ticket's batch, by the server's clock.
    clip_ms : float
        How long the clips last, at once or in turn with what is between, over all views; a second at most
        where nothing was rated.
    digest_right : bool or None
        None where no digest was needed, or as long as the clip was not at hand to check it.
    late : bool
        It came long after it was given.
    interaction : dict of str to Any or None
        The page's summary of presses.
    """

    __tablename__ = "answer_evidence"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    play: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    ticket: Mapped[str] = mapped_column(String(40))
    issued_at: Mapped[datetime]
    received_at: Mapped[datetime]
    clip_ms: Mapped[float]
    digest: Mapped[str | None] = mapped_column(String(64))
    digest_right: Mapped[bool | None]
    late: Mapped[bool]
    interaction: Mapped[dict[str, Any] | None]


# Adaptive series: the trials of a run that belong to one, what was offered for them, and what came of it.

_TRIAL = ["assigned_trials.study_run_id", "assigned_trials.trial_index"]


class SeriesTrial(Base):
    """A trial that shows a stimulus of the grid; practice belongs to no series.

    Attributes
    ----------
    position : int or None
        In its series, from 1.
    role : str
        Of the clip that is the stimulus.
    closed : bool
        The series ended before it, so that it needs no answer.
    """

    __tablename__ = "series_trials"
    __table_args__ = (
        one_of("role", "shown", "first", "second"),
        ForeignKeyConstraint(["study_run_id", "trial_index"], _TRIAL, ondelete="CASCADE"),
    )

    study_run_id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    series: Mapped[str | None] = mapped_column(String(40))
    position: Mapped[int | None]
    role: Mapped[str] = mapped_column(String(10))
    closed: Mapped[bool] = mapped_column(default=False)


class SeriesOffer(Base):
    """A stimulus that the server has chosen for a trial.

    Attributes
    ----------
    known : int
        Answers of the series the choice rests on.
    """

    __tablename__ = "series_offers"
    __table_args__ = (
        ForeignKeyConstraint(["study_run_id", "trial_index"], _TRIAL, ondelete="CASCADE"),
        {"sqlite_with_rowid": False},
    )

    study_run_id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    known: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    version_clip_id: Mapped[int] = mapped_column(ForeignKey("version_clips.id"))


class SeriesAnswer(Base):
    """What one play of such a trial says to its series; written with the rating of that play.

    Attributes
    ----------
    value : float
        Number of the stimulus shown.
    positive : bool or None
        Yes, or the right one of two.
    counts : bool
        Whether it moves the estimate.
    number : int or None
        Its place among those that do, from 1.
    known, ahead : int
        Earlier answers of the series that the choice of the stimulus knew, and did not. The estimate after it
        is written when it has been computed.
    """

    __tablename__ = "series_answers"
    __table_args__ = (ForeignKeyConstraint(["study_run_id", "trial_index"], _TRIAL, ondelete="CASCADE"),)

    study_run_id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    trial_index: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    play: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    version_clip_id: Mapped[int] = mapped_column(ForeignKey("version_clips.id"))
    value: Mapped[float]
    positive: Mapped[bool | None]
    correct: Mapped[bool | None]
    counts: Mapped[bool]
    number: Mapped[int | None]
    known: Mapped[int]
    ahead: Mapped[int]
    threshold: Mapped[float | None]
    threshold_sd: Mapped[float | None]
    spread: Mapped[float | None]
    entropy: Mapped[float | None]
