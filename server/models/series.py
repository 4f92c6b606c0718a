"""Adaptive series: the trials of a run that belong to one, what was offered for them, and what came of it."""

from sqlalchemy import ForeignKey, ForeignKeyConstraint, String
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base, one_of

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
        is written when it has been reckoned.
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
