"""The type of the TOML's [trial]: whichever kind of the registry its key `kind` names."""

from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from experiments.trials import KINDS
from experiments.trials.kind import TrialDeclaration


class ByKind:
    """Annotation: a union over the registry, told apart by `kind`, also where there is one kind only."""

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """A tagged union of the registered declarations."""
        choices = {name: handler.generate_schema(kind.declaration) for name, kind in KINDS.items()}
        union = core_schema.tagged_union_schema(choices, discriminator="kind")
        return core_schema.no_info_before_validator_function(_with_kind, union)


def _with_kind(value: Any) -> Any:
    if isinstance(value, dict) and "kind" not in value:
        return {"kind": next(iter(KINDS)), **value}
    return value


AnyTrial = Annotated[TrialDeclaration, ByKind()]
