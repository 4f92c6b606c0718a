"""What was counted of each run, kept in the transaction of each rating."""

from datetime import datetime

from sqlalchemy import ForeignKey, Text
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base


class RunTally(Base):
    """The counts of one run; `server.tallies.tally` reads and writes the two texts.

    Attributes
    ----------
    heat : str
        A letter a trial.
    not_good : int
        Plays that were flagged or failed.
    counts : str
        Of plays, times and cells, as JSON.
    answers : str
        Packed, by scale, as JSON.
    clip_ms, newest_clip_ms : float
        Of the answers' evidence, in ms: `server.evidence.clip_time.ClipTime`.
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
