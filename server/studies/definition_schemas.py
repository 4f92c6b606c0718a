"""What the endpoints of definitions take and give: texts, their problems, what they expand to, edits."""

from typing import Any, Literal

from pydantic import BaseModel, Field

from server.request_body import RequestBody
from server.studies.fields import TomlText


class DefinitionText(RequestBody):
    """A definition to check."""

    toml: TomlText


class ProblemOut(BaseModel):
    """One thing wrong in a definition."""

    line: int | None
    path: str
    message: str


class BlockOut(BaseModel):
    """A block of the design."""

    label: str
    trials: int


class LevelOut(BaseModel):
    """A level of a factor."""

    name: str
    label: str


class FactorOut(BaseModel):
    """A factor and its levels."""

    name: str
    label: str
    levels: list[LevelOut]


class DesignOut(BaseModel):
    """What a definition expands to."""

    experiment: str
    title: str
    factors: list[FactorOut]
    cells: int
    exemplars: int
    unique_clips: int
    trials_per_participant: int
    blocks: list[BlockOut]
    expected_minutes: float
    notes: list[str] = Field(description="Groups, and how often each clip or pair is expected to be shown.")
    groups: list[str] = Field(description="Groups that links decide; empty where they decide none.")
    turned_away: str = Field(description="Devices that can take no part, in a sentence; empty where all can.")


class Checked(BaseModel):
    """Whether a definition can be used, and what it expands to."""

    problems: list[ProblemOut]
    design: DesignOut | None


class ChangeOut(BaseModel):
    """One key of a definition that an edit changes."""

    path: str
    effect: Literal["wording", "measured"]
    text: str = Field(description="The change in words.")


class JudgedEdit(BaseModel):
    """What saving an edited definition would do to the answers that are stored."""

    changes: list[ChangeOut]
    series: int = Field(description="Data series that answers to the edited definition would be of.")
    present_series: int
    runs: int = Field(description="Runs of the present series, previews aside.")
    begins_series: bool = Field(
        description="A new data series begins, and there are runs it is kept apart from."
    )


class EditDefinition(RequestBody):
    """A definition's text, and what it shall say instead; without `data` the text is read only."""

    toml: TomlText
    data: dict[str, Any] | None = Field(default=None, description="The declaration as the TOML's tables.")


class EditedDefinition(BaseModel):
    """A definition as text and as data, with its problems, or what it expands to."""

    toml: str
    data: dict[str, Any] | None = Field(description="Null where the text is not TOML.")
    problems: list[ProblemOut]
    design: DesignOut | None
