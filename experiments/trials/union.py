"""The type of the TOML's [trial], and of what a page is told of it: whichever kind its key `kind` names."""

from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from experiments.base import Declaration
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


class PageByKind:
    """Annotation: a union over what the pages of the registered kinds are told, told apart by `kind`."""

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """A tagged union of the page models."""
        choices = {name: handler.generate_schema(kind.page) for name, kind in KINDS.items()}
        return core_schema.tagged_union_schema(choices, discriminator="kind")


AnyPage = Annotated[Declaration, PageByKind()]
