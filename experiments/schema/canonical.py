"""One form for equal declarations, and its hash: however written, and whatever keys are added later."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from experiments.base import IMPLIED
from experiments.definition import Experiment
from experiments.schema.format_1 import FIRST_KEYS
from experiments.schema.keys import is_tag
from experiments.schema.upgrades import earlier_names


def definition_sha256(experiment: Experiment) -> str:
    """SHA-256 over the canonical JSON of a declaration: equal for equal declarations, however written."""
    form = canonical(experiment, FIRST_KEYS, earlier_names())
    return hashlib.sha256(as_json(form).encode("utf-8")).hexdigest()


def as_json(form: object) -> str:
    """JSON with sorted keys: the bytes that are hashed."""
    return json.dumps(form, sort_keys=True, ensure_ascii=False)


def canonical(
    declaration: BaseModel, always: frozenset[str], earlier: Mapping[str, str], prefix: str = ""
) -> dict[str, Any]:
    """The declaration as JSON data, without what it leaves at its default.

    Parameters
    ----------
    always : frozenset of str
        Paths of keys that are kept whatever they are set to.
    earlier : mapping of str to str
        Path of each renamed key to the name that stands in the form for it.
    """
    form: dict[str, Any] = {}
    for name, field in type(declaration).model_fields.items():
        parent, value = prefix, getattr(declaration, name)
        hashed_as = earlier.get(f"{parent}{name}", name)
        path = f"{parent}{hashed_as}"
        if path in always or _tells_apart(field) or value != field.get_default(call_default_factory=True):
            form[hashed_as] = _plain(value, always, earlier, f"{path}.")
    return form


def _tells_apart(field: FieldInfo) -> bool:
    return is_tag(field) and IMPLIED not in field.metadata


def _plain(value: Any, always: frozenset[str], earlier: Mapping[str, str], prefix: str) -> Any:
    if isinstance(value, BaseModel):
        return canonical(value, always, earlier, prefix)
    if isinstance(value, Mapping):
        return {key: _plain(item, always, earlier, prefix) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item, always, earlier, prefix) for item in value]
    return value
