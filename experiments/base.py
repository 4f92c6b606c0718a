"""The base of every declaration: frozen, and a key it does not know is an error."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, StringConstraints

from experiments.descriptions import descriptions_are_read

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
    """A frozen piece of a declaration; unknown keys are refused by name.

    The text under a key is its description: docs/reference/experiment.md and the API's schema are made of it.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_serialization_defaults_required=True,
        use_attribute_docstrings=descriptions_are_read(),
    )
