"""What a visit leaves beside its ratings: events, answers to forms, measurements of the screen."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from server.clock import now
from server.models.base import Base, one_of


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
