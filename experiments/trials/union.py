"""Types that are of whichever kind their key `kind` names: a [trial], what a page is told, an answer."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from experiments.base import Declaration
from experiments.trials import KINDS
from experiments.trials.check import CheckAnswer
from experiments.trials.kind import Answer, Kind, TrialDeclaration


@dataclass(frozen=True)
class ByKind:
    """Annotation: a union over the registry, told apart by `kind`, also where there is one kind only.

    Attributes
    ----------
    model : callable
        A kind's member of the union.
    implied : bool
        Whether the first kind is meant where none is named.
    further : tuple of (str, type)
        Members that are of no kind of trial, by their name.
    """

    model: Callable[[Kind], type[BaseModel]]
    implied: bool = False
    further: tuple[tuple[str, type[BaseModel]], ...] = ()

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """A tagged union of the registered models."""
        choices = {name: handler.generate_schema(self.model(kind)) for name, kind in KINDS.items()}
        choices |= {name: handler.generate_schema(model) for name, model in self.further}
        union = core_schema.tagged_union_schema(choices, discriminator="kind")
        return core_schema.no_info_before_validator_function(_with_kind, union) if self.implied else union


def _with_kind(value: Any) -> Any:
    if isinstance(value, dict) and "kind" not in value:
        return {"kind": next(iter(KINDS)), **value}
    return value


AnyTrial = Annotated[TrialDeclaration, ByKind(lambda kind: kind.declaration, implied=True)]
AnyPage = Annotated[Declaration, ByKind(lambda kind: kind.page)]
AnyAnswer = Annotated[Answer, ByKind(lambda kind: kind.answer, further=(("check", CheckAnswer),))]
