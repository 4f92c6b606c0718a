"""A number that no clock or screen can have is stored as unknown: it costs nobody an answer.

A browser may report any number. Where it breaks the bounds of its field, the answer is kept, the number
becomes null, and the play records how many such numbers it had.
"""

import copy
from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, TypeVar

from pydantic import ValidationError

IMPOSSIBLE = "impossible_value"
"""Name of the disturbance that counts the numbers of a play that were made unknown."""
Path = tuple[str, ...]
Model = TypeVar("Model")
ANY = "*"
OF_VALUES = (
    "greater_than",
    "less_than",
    "finite_number",
    "int_",
    "float_",
    "datetime_",
    "timezone_",
    "too_long",
)
"""Faults of a value; those of a name or of a missing part are of the page, whatever its browser reports."""
MAX_PASSES = 4
"""A value can hide the fault of another: each look names those that are left."""
LEFT_OUT = object()
"""Stands for a value whose key is left out where it is unknown."""


def validated(
    data: Any,
    validate: Callable[[Any], Model],
    measured: Mapping[Path, Any],
    count: Callable[[Any, Set[Path]], None],
) -> Model:
    """The model of what a page has sent, measured values that break their bounds made unknown.

    Parameters
    ----------
    data : Any
        As it was sent; it is left as it is.
    validate : callable
        Gives the model, or a ValidationError.
    measured : mapping of tuple of str to Any
        By the path of a measured value, what stands there where it is unknown; `*` is any key or index.
    count : callable
        Notes in the repaired data which values were made unknown.

    Raises
    ------
    ValidationError
        Something else is wrong, too.
    """
    try:
        return validate(data)
    except ValidationError as error:
        fault = error
    repaired, unknown = copy.deepcopy(data), set[Path]()
    for _ in range(MAX_PASSES):
        for detail in fault.errors(include_url=False, include_context=False, include_input=False):
            is_value = detail["type"].startswith(OF_VALUES)
            cleared = _path_cleared(repaired, detail["loc"], measured) if is_value else None
            if cleared is None:
                raise fault
            _clear(repaired, *cleared)
            unknown.add(cleared[0])
        count(repaired, unknown)
        try:
            return validate(repaired)
        except ValidationError as error:
            fault = error
    raise fault


def _path_cleared(
    data: Any, location: Sequence[int | str], measured: Mapping[Path, Any]
) -> tuple[Path, Any] | None:
    """The path in the data of the measured value with this fault, and what is to be there instead."""
    steps: list[str] = []
    here = data
    for step in location:
        held = _held(here, step)
        # Of a choice between models the fault names the one chosen, which is no key of the data.
        if held is LEFT_OUT and isinstance(here, dict) and step == here.get("kind"):
            continue
        steps.append(str(step))
        here = held
        pattern = next((path for path in measured if _fits(path, steps)), None)
        if pattern is not None:
            return tuple(steps), measured[pattern]
    return None


def _held(value: Any, step: int | str) -> Any:
    if isinstance(value, dict):
        return value.get(step, LEFT_OUT)
    if isinstance(value, list) and isinstance(step, int) and step < len(value):
        return value[step]
    return LEFT_OUT


def _fits(path: Path, steps: Sequence[str]) -> bool:
    return len(path) == len(steps) and all(one in (ANY, step) for one, step in zip(path, steps, strict=True))


def _clear(data: Any, path: Path, unknown: Any) -> None:
    *above, last = path
    for step in above:
        data = data[int(step)] if isinstance(data, list) else data.setdefault(step, {})
    if unknown is LEFT_OUT:
        data.pop(last, None)
    else:
        data[last] = copy.deepcopy(unknown)
