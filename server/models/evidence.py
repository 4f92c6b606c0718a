"""What came with each answer to show how it came about."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base


class AnswerEvidence(Base):
    """The evidence of one answer: one play of one trial.

    Attributes
    ----------
    issued_at : datetime
        Of the ticket's batch, by the server's clock.
    clip_ms : float
        How long the clips last, at once or in turn with what is between, over all views.
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
