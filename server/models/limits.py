"""What the processes of a server on PostgreSQL count together: who may do something how often."""

from datetime import datetime

from sqlalchemy import Index, String
from sqlalchemy.orm import Mapped, mapped_column

from server.models.base import Base


class SharedCount(Base):
    """A share that is used up and refilled, or a row of failures; it is no data and in no backup or copy.

    Attributes
    ----------
    key : str
        Keyed hash of what is counted, such as a range of addresses; it cannot be read back.
    amount : float
        What is left of the share, or how many failures there were.
    before : float
        What was left, refilled, before the last event.
    at : datetime
        When it was changed last; it goes some hours later.
    """

    __tablename__ = "shared_counts"
    __table_args__ = (Index("ix_shared_counts_at", "at"),)

    key: Mapped[str] = mapped_column(String(32), primary_key=True)
    amount: Mapped[float]
    before: Mapped[float]
    at: Mapped[datetime]
