"""Each time that clips of a trial were shown, with the frames that were drawn."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, ForeignKeyConstraint, String, Text, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from server.clock import now
from server.models.base import Base, one_of
from server.models.trials import CLIP_ROLES


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
        Null until it has ended, or where an older page does not tell.
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
        What was drawn when, as `server.views.frame_log` packs it.
    """

    __tablename__ = "view_clips"
    __table_args__ = (one_of("role", *CLIP_ROLES),)

    view: Mapped[int] = mapped_column(
        ForeignKey("views.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    role: Mapped[str] = mapped_column(String(10), primary_key=True)
    clip_sha256: Mapped[str] = mapped_column(String(64))
    frame_log: Mapped[str] = mapped_column(Text)
