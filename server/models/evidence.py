"""What came with each answer to show how it came about."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base


class AnswerEvidence(Base):
    """The evidence of one answer: one play of one trial.

    issued_at: of the ticket's batch, by the server's clock. clip_ms: how long the clip lasts, over all views.
    digest_right: None where no digest was needed, or the clip was not at hand to check it.
    late: it came long after it was given. interaction: the page's summary of presses.
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
