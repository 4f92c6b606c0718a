"""docs/reference/experiment.md: every key of a declaration, from the models that read it."""

from __future__ import annotations

import json
import tomllib
import types
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Len, Lt, MaxLen, MinLen, MultipleOf
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from experiments.declaration.base import Language, LevelName, Name
from experiments.declaration.experiment import Experiment
from experiments.declaration.forms import Form, Question
from experiments.declaration.rendering import ProfileName
from experiments.declaration.tables import Answer, GroupName
from experiments.declaration.trial import TrialDeclaration
from experiments.kinds import KINDS
from experiments.load import parse_experiment
from experiments.schema.effects import Key, is_tag, keys, models_inside

EXAMPLES = Path(__file__).resolve().parent.parent / "docs" / "reference" / "every-key.toml"
HEADER = ("key", "type", "default", "range", "meaning", "example")
LONGEST_EXAMPLE = 70

INTRODUCTION = """\
A study is declared in one TOML file. `stimuli plan FILE` shows what it expands to, and reports errors with
their line. `experiments/exp1.toml` is a whole study to start from; [every-key.toml](every-key.toml) sets most
keys, and most examples below are taken from it. Optional keys have a default. Times, sizes and counts have
their unit in the name or the meaning. A text in several languages is a table: `{ en = "...", de = "..." }`.
"""


def experiment_reference(made: str) -> Iterator[str]:
    """The page's lines: one section per table of the TOML, with one row per key."""
    yield from (made, "# The declaration of a study", "", INTRODUCTION)
    examples = Examples()
    for heading, model, path in tables():
        yield f"## {heading}"
        yield ""
        yield " ".join((model.__doc__ or "").split())
        yield ""
        yield "| " + " | ".join(HEADER) + " |"
        yield "|" + "---|" * len(HEADER)
        for name, field in model.model_fields.items():
            cells = row(Key(f"{path}{name}", model, field), examples)
            yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
        yield ""


def tables() -> Iterator[tuple[str, type[BaseModel], str]]:
    """Heading, model and path (with its last dot) of every table; the members of a union are one each."""
    yield "The top of the file", Experiment, ""
    seen = set()
    for key in keys():
        for model in key.tables:
            if (model, key.path) not in seen:
                seen.add((model, key.path))
                yield heading(key, model), model, f"{key.path}."


def heading(key: Key, model: type[BaseModel]) -> str:
    """As the TOML writes the table: in two brackets if it may occur several times."""
    path = f"{key.path}.en" if get_origin(key.field.annotation) is dict else key.path
    written = f"[[{path}]]" if get_origin(key.field.annotation) is tuple else f"[{path}]"
    tag = next((name for name, field in model.model_fields.items() if _tells_apart(key, field)), None)
    if tag is None and key.path in _of_several_kinds():
        model, tag = key.model, "kind"
    return f"`{written}`" + (f" with `{tag} = {toml(model.model_fields[tag].default)}`" if tag else "")


@cache
def _of_several_kinds() -> frozenset[str]:
    """Paths of tables of which each kind of trial has its own."""
    named = Counter(key.path for key in keys() if key.tables and issubclass(key.model, TrialDeclaration))
    return frozenset(path for path, kinds in named.items() if kinds > 1)


def _tells_apart(key: Key, field: FieldInfo) -> bool:
    return is_tag(field) and (
        len(key.tables) > 1 or (issubclass(key.model, Experiment) and key.name == "trial")
    )


def row(key: Key, examples: Examples) -> tuple[str, ...]:
    """One key."""
    return (
        f"`{key.name}`",
        type_of(key),
        default_of(key.field),
        range_of(key.field),
        " ".join((key.field.description or "").split()),
        examples.of(key),
    )


def type_of(key: Key) -> str:
    """The type as one says it."""
    if key.tables and issubclass(key.tables[0], TrialDeclaration):
        return "table"
    return spoken(key.field.annotation, list(key.field.metadata))


NAMED = {Name: "name", LevelName: "level name", Language: "language tag", ProfileName: "profile or file"}
KEYS = {GroupName: "group", Answer: "answer", LevelName: "level", Name: "factor"}


def spoken(annotation: Any, marks: list[Any] | None = None) -> str:
    """An annotation in words."""
    for alias, word in NAMED.items():
        if annotation == alias or (marks and annotation is str and set(map(repr, marks)) & _marks_of(alias)):
            return word
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return spoken(arguments[0])
    if origin is Literal:
        return "one of" if len(arguments) > 1 else "constant"
    if origin in (types.UnionType, Union):
        inner = [argument for argument in arguments if argument is not type(None)]
        return "table" if _is_model(inner[0]) else spoken(inner[0])
    if origin is tuple:
        return "tables" if spoken(arguments[0]) == "table" else f"list of {plural(spoken(arguments[0]))}"
    if origin is dict:
        return _spoken_mapping(*arguments)
    if _is_model(annotation):
        return "table"
    return {str: "text", int: "whole number", float: "number", bool: "true or false"}[annotation]


def _spoken_mapping(key: Any, value: Any) -> str:
    if key == Language:
        return "tables by language" if _is_model(value) else "text by language"
    return f"{spoken(value)} by {KEYS.get(key, 'name')}"


def plural(words: str) -> str:
    """The plural of a type in words, by its first noun."""
    if words == "one of":
        return "any of"
    head, _, rest = words.partition(" of " if " of " in words else " by ")
    joint = " of " if " of " in words else " by "
    return f"{head}s{joint}{rest}" if rest else f"{words}s"


def _marks_of(alias: Any) -> set[str]:
    return set(map(repr, get_args(alias)[1:]))


def _is_model(annotation: Any) -> bool:
    if get_origin(annotation) is Annotated:
        return _is_model(get_args(annotation)[0])
    if get_origin(annotation) in (types.UnionType, Union):
        return _is_model(get_args(annotation)[0])
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def default_of(field: FieldInfo) -> str:
    """The default as TOML; what has to be given says so."""
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined:
        return "left out"
    if isinstance(value, BaseModel):
        return "its keys' defaults"
    return f"`{toml(value)}`" if value != "" else "empty"


def range_of(field: FieldInfo) -> str:
    """The values that are taken, empty where any of the type are."""
    literal = _literals(field.annotation)
    if literal:
        return ", ".join(f"`{toml(value)}`" for value in literal)
    marks = [*field.metadata, *_marks_inside(field.annotation)]
    return ", ".join(filter(None, map(limit, marks)))


def limit(mark: Any) -> str:
    """One limit in words."""
    match mark:
        case Ge(ge=low):
            return f"{low} or more"
        case Gt(gt=low):
            return f"more than {low}"
        case Le(le=high):
            return f"at most {high}"
        case Lt(lt=high):
            return f"less than {high}"
        case MultipleOf(multiple_of=step):
            return f"in steps of {step}"
        case MinLen(min_length=least) | Len(min_length=least):
            return f"{least} or more of them"
        case MaxLen(max_length=longest):
            return f"at most {longest} of them"
    pattern = getattr(mark, "pattern", None)
    return f"matches `{pattern}`" if pattern else ""


def _literals(annotation: Any) -> tuple[Any, ...]:
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    if get_origin(annotation) in (types.UnionType, Union):
        return next(filter(None, map(_literals, get_args(annotation))), ())
    return ()


def _marks_inside(annotation: Any) -> Iterator[Any]:
    """The limits of an optional value."""
    if get_origin(annotation) in (types.UnionType, Union):
        for argument in get_args(annotation):
            if get_origin(argument) is Annotated:
                for mark in get_args(argument)[1:]:
                    yield from getattr(mark, "metadata", [mark])


class Examples:
    """What each key is set to in the example files: the first table of its model that sets it."""

    def __init__(self) -> None:
        self._set: dict[tuple[str, type[BaseModel]], Any] = {}
        self._anywhere: dict[tuple[str, type[BaseModel]], Any] = {}
        for path in (EXAMPLES, *sorted(EXAMPLES.parent.glob("*.toml"))):
            self._collect(parse_experiment(path.read_text(encoding="utf-8"), path.name), "")
        for kind in KINDS.values():
            for text in (kind.example, *kind.further_examples):
                self._collect(kind.declaration.model_validate(tomllib.loads(text)["trial"]), "trial.")
        for field in models_inside(Form.model_fields["fields"].annotation):
            if issubclass(field, Question) and field.example:
                self._collect(field.model_validate(tomllib.loads(field.example)), "forms.fields.")

    def _collect(self, value: Any, path: str) -> None:
        if isinstance(value, BaseModel):
            for name in value.model_fields_set:
                inner = getattr(value, name)
                self._set.setdefault((f"{path}{name}", type(value)), inner)
                self._anywhere.setdefault((name, type(value)), inner)
                self._collect(inner, f"{path}{name}.")
        elif isinstance(value, Mapping):
            for item in value.values():
                self._collect(item, path)
        elif isinstance(value, tuple | list):
            for item in value:
                self._collect(item, path)

    def has(self, key: Key) -> bool:
        """True where an example sets the key, of its table in this place or of the same in another."""
        return (key.name, key.model) in self._anywhere

    def of(self, key: Key) -> str:
        """The key's example as TOML, shortened where it is long; tables have a separate section."""
        if not self.has(key) or key.tables:
            return ""
        written = toml(self._set.get((key.path, key.model), self._anywhere[key.name, key.model]))
        if len(written) > LONGEST_EXAMPLE:
            written = f"{written[:LONGEST_EXAMPLE]}..."
        return f"`{written}`"


def toml(value: Any) -> str:
    """A value as one line of TOML."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
