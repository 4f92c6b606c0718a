"""What tickets and evidence look like between page and server."""

from typing import Annotated, Self

from pydantic import BaseModel, Field, StringConstraints, model_validator

Milliseconds = Annotated[float, Field(ge=0, le=1e10, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, le=1_000_000)]


class Tickets(BaseModel):
    """A sealed batch of tickets, with every trial's tickets: by trial index, then by play from 1 on."""

    batch: str
    by_trial: list[list[str]]


class Interaction(BaseModel):
    """How the participant acted between two answers, summed up on the page; no trace is sent.

    A press is a key or pointer button going down and up again, or an activation without one.
    """

    presses: Count
    trusted: Count = Field(description="Presses that the browser made from input, not a script.")
    press_ms: Milliseconds | None = Field(
        default=None, description="Median time from down to up; null where no press had both."
    )
    moves: Count = Field(default=0, description="Pointer movements.")

    @model_validator(mode="after")
    def _trusted_are_presses(self) -> Self:
        if self.trusted > self.presses:
            raise ValueError(
                f"expected at most as many trusted presses as presses, got {self.trusted} of {self.presses}"
            )
        return self


class ViewEvidence(BaseModel):
    """What a view brings along: the ticket of its play, with the batch that it is of."""

    batch: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9._-]{1,160}$")]
    ticket: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class RatingEvidence(ViewEvidence):
    """What a rating brings along to show how it came about."""

    digest: Annotated[str, StringConstraints(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None,
        description="HMAC-SHA-256, with the ticket as key, of the SHA-512 of each clip of the trial, joined.",
    )
    interaction: Interaction | None = None
