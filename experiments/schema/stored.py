"""Upgrade the data of a declaration from the format it was stored in to the newest one."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

from experiments.errors import InputError

# From the format a declaration was stored in to the one this program reads.
#
# A new key with a default needs nothing here. A key that gets another name, or moves, needs a step: a file
# `upgrade_N_M.py` with its `Step`, one line in `STEPS`, and a stored definition of format N in
# `tests/golden/definitions`.


@dataclass(frozen=True)
class Step:
    """From one format to the next.

    Attributes
    ----------
    renamed : mapping of str to str
        Path before (`trial.fixation_ms`) to the key's new name. The hash goes on under the old name.
    change : callable or None
        Whatever else is to be done, on a copy of the data; None where renaming is all.
    """

    renamed: Mapping[str, str] = field(default_factory=dict)
    change: Callable[[dict[str, Any]], None] | None = None


STEPS: tuple[Step, ...] = ()
"""The step from format 1 to 2 first."""

FORMAT = 1 + len(STEPS)
"""The format of this program. A declaration without a number is of format 1."""


def upgrade_data(data: Mapping[str, Any], number: object, steps: Sequence[Step] = STEPS) -> dict[str, Any]:
    """A copy of `data`, of format `number`, as the newest format has it; InputError for formats not known."""
    newest = 1 + len(steps)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise InputError(f"format: expected a whole number from 1 to {newest}, got {number!r}")
    if number > newest:
        raise InputError(
            f"format: this program reads formats 1 to {newest}, got {number}; use a newer version of it"
        )
    copied = deepcopy(dict(data))
    for step in steps[number - 1 :]:
        for path, name in step.renamed.items():
            _rename(copied, path.split("."), name)
        if step.change is not None:
            step.change(copied)
    return copied


def earlier_names(steps: Sequence[Step] = STEPS) -> dict[str, str]:
    """Present path of each renamed key to the name that it was first hashed under."""
    first: dict[str, str] = {}
    for step in steps:
        for path, name in step.renamed.items():
            parent, _, before = path.rpartition(".")
            first[f"{parent}.{name}" if parent else name] = first.pop(path, before)
    return first


def _rename(data: Any, path: Sequence[str], name: str) -> None:
    if isinstance(data, list | tuple):
        for item in data:
            _rename(item, path, name)
    elif isinstance(data, dict) and len(path) > 1:
        _rename(data.get(path[0]), path[1:], name)
    elif isinstance(data, dict) and path[0] in data:
        data.setdefault(name, data.pop(path[0]))
