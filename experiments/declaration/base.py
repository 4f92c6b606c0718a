"""The base of every declaration: frozen, and an unknown key is an error; and names within one."""

from collections.abc import Iterable, Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, StringConstraints

from experiments.declaration import descriptions_are_read

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,39}$")]
"""A factor, experiment or form name: letters, digits and underscores, at most 40, a letter first."""

LevelName = Annotated[str, StringConstraints(pattern=r"^[^/\x00-\x1f]{1,60}$")]
"""A level name: up to 60 printable characters without a slash, which separates levels in a cell label."""

Language = Annotated[str, StringConstraints(pattern=r"^[a-z]{2}(-[A-Z]{2})?$")]
"""A language tag such as `en`, `de` or `pt-BR`."""

Translated = dict[Language, str]
"""The same text in several languages, by language tag."""


IMPLIED = "implied"
"""Marks (in `Annotated`) the tag of the union member meant where no tag is given: it is not hashed."""


class Declaration(BaseModel):
    """A frozen part of a declaration; unknown keys are refused by name.

    The text under a key is its description. It appears in docs/reference/experiment.md and in the API's
    schema.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_serialization_defaults_required=True,
        use_attribute_docstrings=descriptions_are_read(),
    )


# Names within one declaration: each is used once, and none is a column of the export.


def refuse_repeats(names: Sequence[str], what: str) -> None:
    """Raise ValueError if a name occurs twice; `what` says what the names belong to."""
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ValueError(f"each {what} needs a unique name; '{repeated[0]}' is used twice")


def refuse_reserved(names: Iterable[str], reserved: frozenset[str]) -> None:
    """Raise ValueError if a factor has the name of another column of the export."""
    for name in names:
        if name in reserved:
            raise ValueError(f"factor '{name}' has the name of a ratings column; choose another")
