"""What happens when a participant comes back, and for how long a place is kept."""

from typing import Annotated, Literal

from pydantic import Field

from experiments.base import Declaration


class Session(Declaration):
    """What happens when a participant comes back."""

    resume: Literal["resume", "restart", "block"] = "resume"
    """Coming back goes on at the next trial, begins a new run (the old one is withdrawn), or is refused."""
    maximum_age_hours: Annotated[float, Field(gt=0)] = 72.0
    """Hours after its start at which a run can no longer be taken up again."""
    lease_minutes: Annotated[float, Field(gt=0)] = 120.0
    """Minutes without a sign of life after which an unfinished run's place (quota, counterbalancing slot)
    goes to somebody else. What it answered stays."""
