"""What is erased by the declared periods, as pages and the command line show it."""

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

What = Literal["identifiers", "unfinished", "answers"]


class Period(BaseModel):
    """One declared period of a study."""

    what: What = Field(description="Who took part; unfinished visits as a whole; every visit as a whole.")
    days: int = Field(description="After a visit's last sign of life; of the version that new runs use.")


class RetentionPreview(BaseModel):
    """What would be erased at this moment, and when something is due next."""

    study: str
    periods: list[Period] = Field(description="As the version declares them that new runs use.")
    identifiers: int = Field(description="Visits whose identifiers are due.")
    visits: int = Field(description="Visits that are due as a whole.")
    next_at: datetime | None = Field(description="When more is due; null where nothing is on its way.")
