"""What a kind of trial is made of. Everything else reads it from here."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, Field

from experiments.assignment.trial import Trial
from experiments.base import Declaration
from experiments.columns.view import View
from experiments.schema.effects import Effect

if TYPE_CHECKING:
    from experiments.definition import Experiment


class TrialDeclaration(Declaration):
    """What every kind declares; each adds its own keys, and a constant as its `kind`."""

    kind: str
    expected_seconds: Annotated[float, Field(gt=0)] = 6.0


@dataclass(frozen=True)
class Kind:
    """A kind of trial.

    Attributes
    ----------
    declaration: the model of the TOML's [trial]; the constant of its `kind` is the name.
    answer: the model of what a participant answers to one trial.
    view: the rows it exports.
    roles: the clips a trial shows, in the order of their places (`shown`; `left`, `right`).
    effects: what an edit of each key of the declaration does to stored answers, by path below [trial].
    page: what of the declaration the participant's page is told. shown: makes it.
    assign: the trials of one participant in order, by declaration, seed and slot.
    example: a [trial] as TOML, for the reference; it is what a newcomer copies.
    """

    declaration: type[TrialDeclaration]
    answer: type[BaseModel]
    view: View
    roles: tuple[str, ...]
    effects: Mapping[str, Effect]
    page: type[Declaration]
    shown: "Callable[[Experiment], Declaration]"
    assign: "Callable[[Experiment, int, int], list[Trial]]"
    example: str

    @property
    def name(self) -> str:
        """As the TOML, the database and the API name it."""
        return str(self.declaration.model_fields["kind"].default)
