"""What was counted of each run, kept in the transaction of each rating."""

from sqlalchemy import ForeignKey, Text
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base


class RunTally(Base):
    """The counts of one run; `server.tallies.tally` reads and writes the two texts.

    heat: a letter a trial. not_good: plays that were flagged or failed.
    counts: of plays, times and cells, as JSON. answers: packed, by scale, as JSON.
    """

    __tablename__ = "run_tallies"

    study_run_id: Mapped[int] = mapped_column(
        ForeignKey("study_runs.id", ondelete="CASCADE"), primary_key=True, autoincrement=False
    )
    heat: Mapped[str] = mapped_column(Text)
    not_good: Mapped[int]
    counts: Mapped[str] = mapped_column(Text)
    answers: Mapped[str] = mapped_column(Text)
