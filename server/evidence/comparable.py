"""Answers of any kind of trial as values that can be compared."""

import json
from collections.abc import Mapping
from typing import Any


def comparable(payload: Mapping[str, Any]) -> int | str | None:
    """A stored answer as one value, equal for equal answers; None where nothing was answered."""
    said = {name: _without_time(value) for name, value in payload.items() if value is not None}
    if said.keys() == {"response"}:
        return said["response"] if isinstance(said["response"], int) else str(said["response"])
    scales = payload.get("answers", {}).values()
    if scales and all(one["response"] is None and not one.get("not_applicable") for one in scales):
        return None
    return json.dumps(said, sort_keys=True) if said else None


def _without_time(value: Any) -> Any:
    """An answer on several scales without the times that each took: equal answers must be equal."""
    if not isinstance(value, dict):
        return value
    return {name: {**one, "rt": None} if isinstance(one, dict) else one for name, one in value.items()}
