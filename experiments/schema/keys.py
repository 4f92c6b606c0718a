"""The keys of a declaration as dotted paths, by walking the models: `factors.levels.render.fps`.

List indices are left out of a path, and a mapping from languages to texts is one key. Models of a union share
their paths.
"""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from experiments.declaration.experiment import Experiment
from experiments.declaration.trial import ByKind


class Key(NamedTuple):
    """One key: its path, the model that declares it, and how."""

    path: str
    model: type[BaseModel]
    field: FieldInfo

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition(".")[2]

    @property
    def tables(self) -> list[type[BaseModel]]:
        """The models that the key may hold, with keys of their own."""
        for mark in self.field.metadata:
            if isinstance(mark, ByKind):
                return list(mark.models().values())
        return models_inside(self.field.annotation)


def keys(model: type[BaseModel] = Experiment, prefix: str = "") -> Iterator[Key]:
    """Every key of `model` and of the models inside, depth first; a table comes before its keys."""
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        key = Key(path, model, field)
        yield key
        for inner in key.tables:
            yield from keys(inner, f"{path}.")


def paths(model: type[BaseModel] = Experiment, prefix: str = "") -> set[str]:
    """Paths of the keys that hold values rather than further keys."""
    return {key.path for key in keys(model, prefix) if not key.tables}


def models_inside(annotation: Any) -> list[type[BaseModel]]:
    """The models a key may hold: itself, or the members of a union, tuple or mapping."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) is Literal:
        return []
    return [model for argument in get_args(annotation) for model in models_inside(argument)]


def is_tag(field: FieldInfo) -> bool:
    """True for the key that tells the members of a union apart: one constant is all it may be."""
    return get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1
