"""A dress rehearsal: its settings, its progress, and what it showed."""

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

DEFINITION, MANIFEST, ORDER = "definition.toml", "manifest.json", "order.json"
"""Files that the sandbox reads."""
RESULT, REPORT = "rehearsal.json", "report"
"""What it writes: a file and a folder."""


class NewRehearsal(BaseModel):
    """How many people are simulated; the same seed gives the same people."""

    model_config = ConfigDict(extra="forbid")
    participants: int = Field(default=8, ge=1, le=60)
    seed: int = Field(default=1, ge=0, le=1_000_000)


class RehearsalOut(BaseModel):
    """A rehearsal that waits, goes on, is done or has failed (then `message` says why)."""

    id: str
    status: Literal["queued", "running", "done", "failed", "cancelled"]
    progress: float
    message: str
    version: int
    participants: int
    created_at: datetime


class RehearsedTrial(BaseModel):
    """One trial in a simulated person's order."""

    trial_index: int
    kind: str
    block: str
    clips: list[str]


class RehearsedPerson(BaseModel):
    """In which order one simulated person saw what."""

    number: int
    group: str
    status: str
    minutes: float = Field(description="Clips and answers; no forms, breaks or texts.")
    trials: list[RehearsedTrial]


class RehearsedColumn(BaseModel):
    """A column of the data, with a value that a simulated person left."""

    table: str
    name: str
    type: str
    meaning: str
    example: str


class Power(BaseModel):
    """What `analysis plan` says of the design, and what was assumed for it."""

    assumed: str
    command: str
    n: list[int]
    effects: list[str]
    power: list[list[float]] = Field(description="One list per effect, one value per number of participants.")
    text: str


class RehearsalResult(BaseModel):
    """What the rehearsal showed."""

    participants: int
    complete: int
    answers: int
    expected_minutes: float = Field(description="Declared seconds per trial times the number of trials.")
    people: list[RehearsedPerson] = Field(description="The first few.")
    columns: list[RehearsedColumn]
    report: list[str] = Field(description="Files of the report; empty if there is a `report_problem`.")
    report_problem: str
    power: Power | None
    power_problem: str


class Order(BaseModel):
    """What the sandbox gets, in addition to the definition and the manifest."""

    participants: int
    seed: int


class Step(BaseModel):
    """A line that the sandbox prints: how far it is, or why it cannot go on."""

    share: float = 0.0
    step: str = ""
    problem: str = ""


def example_of(value: Any) -> str:
    """A stored value as a page shows it, at most 60 characters."""
    text = "" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
