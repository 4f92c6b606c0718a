"""The kinds of trial, and the registry that finds them by name.

A new kind needs a file with its name in `experiments.declaration`, for its [trial], and one here, with its
`Kind`. Both are found by name.
"""

from importlib import import_module
from typing import Annotated

from experiments.columns.view import View
from experiments.declaration.any_trial import TRIALS, CheckAnswer
from experiments.declaration.base import Declaration
from experiments.declaration.trial import Answer, ByKind
from experiments.kinds.kind import Kind


def _kind_in(name: str) -> Kind:
    """The kind of a file of this folder."""
    module = import_module(f"experiments.kinds.{name}")
    for value in vars(module).values():
        if isinstance(value, Kind) and value.name == name:
            return value
    raise TypeError(f"{module.__name__}: expected a Kind called '{name}', found none")


KINDS: dict[str, Kind] = {name: _kind_in(name) for name in TRIALS}
"""Every kind by its name in the TOML; the first is the default."""


def views() -> tuple[View, ...]:
    """The SQL views of all kinds, which every upgrade recreates (`server.core.database_views`)."""
    return tuple(kind.view for kind in KINDS.values())


def reserved_names() -> frozenset[str]:
    """Names that no factor may have, because other columns of the export have them."""
    return frozenset(name for view in views() for name in view.names)


# Types whose kind is named by their key `kind`: what a page gets, an answer.

AnyPage = Annotated[Declaration, ByKind(lambda: {name: kind.page for name, kind in KINDS.items()})]
AnyAnswer = Annotated[
    Answer, ByKind(lambda: {**{name: kind.answer for name, kind in KINDS.items()}, "check": CheckAnswer})
]
