"""One format for rejecting bad input: what was expected, what was received, and what to do."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from table_files import InputError as InputError
from table_files import counted as counted
from table_files import did_you_mean as did_you_mean
from table_files import nearest as nearest


def and_others(number: int) -> str:
    """Return ` (and 2 more problems)` for the end of a line that reports the first; empty if it is the only
    one."""
    return f" (and {number} more problem{'s' if number > 1 else ''})" if number else ""


# What was expected and what was received, in words, for every value that a model refuses.

MAX_SHOWN = 60

Context = Mapping[str, Any]
"""The model's description of its limit: `ge`, `pattern`, `min_length`..."""

TYPES = {
    "string_type": "a text in quotes",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of at most 4,000 digits",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
}
PATTERNS = {
    r"^[A-Za-z][A-Za-z0-9_]{0,39}$": "a name of letters, digits and underscores that begins with a letter",
    r"^[^/\x00-\x1f]{1,60}$": "1 to 60 characters without a slash",
    r"^[a-z]{2}(-[A-Z]{2})?$": "a language such as en or pt-BR",
    r"^(https?://\S+|[A-Za-z0-9][A-Za-z0-9.+-]{1,60})$": "a license such as CC-BY-4.0, or its web address",
    r"^\d{4}-\d{4}-\d{4}-\d{3}[\dX]$": "an ORCID such as 0000-0002-1825-0097",
    r"^#[0-9a-f]{6}$": "a color such as #808080",
    r"^[^\x00-\x1f]{1,600}$": "a line of 1 to 600 characters",
    r"^(turn|link|form:[A-Za-z][A-Za-z0-9_]{0,39})$": "turn, link, or form: and the name of a form",
}
"""What the regular expressions of the declaration demand, in words."""
LIMITS: dict[str, Callable[[Context], str]] = {
    "literal_error": lambda limit: _one_of(str(limit["expected"])),
    "greater_than": lambda limit: f"more than {_number(limit['gt'])}",
    "greater_than_equal": lambda limit: f"{_number(limit['ge'])} or more",
    "less_than": lambda limit: f"less than {_number(limit['lt'])}",
    "less_than_equal": lambda limit: f"at most {_number(limit['le'])}",
    "multiple_of": lambda limit: f"a multiple of {_number(limit['multiple_of'])}",
    "string_pattern_mismatch": lambda limit: PATTERNS.get(
        str(limit["pattern"]), f"a text that matches {limit['pattern']}"
    ),
    "string_too_short": lambda limit: f"a text of {counted(limit['min_length'], 'character')} or more",
    "string_too_long": lambda limit: f"a text of at most {counted(limit['max_length'], 'character')}",
    "too_short": lambda limit: f"a list of {counted(limit['min_length'], 'item')} or more",
    "too_long": lambda limit: f"a list of at most {counted(limit['max_length'], 'item')}",
}


def wrong_value(detail: Mapping[str, Any]) -> str:
    """One error of pydantic in words: `expected a whole number, got "ten"`.

    Examples
    --------
    >>> wrong_value({"type": "int_type", "loc": ("participants",), "input": "ten", "msg": ""})
    "expected a whole number, got 'ten'"
    >>> wrong_value({"type": "tuple_type", "loc": ("factors",), "input": {"name": "face"}, "msg": ""})
    'expected a list, got a table with the key name; a list of tables is written [[factors]]'
    """
    kind, given, context = detail["type"], detail.get("input"), detail.get("ctx") or {}
    if kind == "missing":
        return "this key is required but missing"
    expected = expectation(detail)
    if expected is None:
        message = str(detail["msg"]).removeprefix("Value error, ")
        said = isinstance(given, dict | list | tuple) or ", got " in message
        return message if said else f"{message}, got {as_toml(given)}"
    if kind == "literal_error" and isinstance(given, str):
        allowed = [word.strip("' ") for word in str(context["expected"]).replace(" or ", ", ").split(",")]
        return f"expected {expected}, got {as_toml(given)}" + _nearest(given, allowed)
    return f"expected {expected}, got {as_toml(given)}{_way_out(kind, detail)}"


def expectation(detail: Mapping[str, Any]) -> str | None:
    """What was expected, if pydantic reports a type or a limit; None if a validator has its own message.

    Examples
    --------
    >>> expectation({"type": "greater_than_equal", "ctx": {"ge": 1}})
    '1 or more'
    """
    kind, given = detail["type"], detail.get("input")
    # nan is neither above nor below a limit.
    if isinstance(given, float) and math.isnan(given):
        return "a number"
    return LIMITS[kind](detail["ctx"]) if kind in LIMITS else TYPES.get(kind)


def is_follower(detail: Mapping[str, Any]) -> bool:
    """Whether the error follows from others: a list is too short only because its wrong items were
    removed."""
    return detail["type"] == "too_short" and bool(len(detail["input"]) >= detail["ctx"]["min_length"])


def _nearest(word: str, allowed: list[str]) -> str:
    near = did_you_mean(word, allowed)
    return near if near.startswith("; did you mean") else ""


def _way_out(kind: str, detail: Mapping[str, Any]) -> str:
    """How to write the right kind of table in TOML, if the other kind was written."""
    table = ".".join(part for part in detail["loc"] if isinstance(part, str))
    ends_in_key = isinstance(detail["loc"][-1], str) if detail["loc"] else False
    if kind == "tuple_type" and isinstance(detail["input"], dict):
        return f"; a list of tables is written [[{table}]]"
    if kind.startswith("model") and ends_in_key and _is_tables(detail["input"]):
        return f"; a table is written [{table}]"
    return ""


def _is_tables(given: Any) -> bool:
    return isinstance(given, list | tuple) and bool(given) and all(isinstance(one, dict) for one in given)


def as_toml(given: Any) -> str:
    """A value as written in TOML; long values are cut off, and tables are shown by their keys."""
    if isinstance(given, str):
        return repr(given) if len(given) <= MAX_SHOWN else f"{given[:MAX_SHOWN]!r}..."
    if isinstance(given, dict):
        plural = "s" if len(given) > 1 else ""
        return f"a table with the key{plural} {_cut(', '.join(given))}" if given else "an empty table"
    if isinstance(given, list | tuple):
        return f"the list {_cut(_inline(given))}" if given else "an empty list"
    if given is None:
        return "nothing"
    return _inline(given)


def _inline(given: Any) -> str:
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, list | tuple):
        return f"[{', '.join(map(_inline, given))}]"
    if isinstance(given, dict):
        return "{ " + ", ".join(f"{key} = {_inline(value)}" for key, value in given.items()) + " }"
    return json.dumps(given, ensure_ascii=False) if isinstance(given, str) else str(given)


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


def _one_of(expected: str) -> str:
    return f"one of {expected}" if " or " in expected else expected


def _number(limit: float | str) -> str:
    if isinstance(limit, str):  # a point in time
        return limit
    return f"{limit:,}" if limit != int(limit) else f"{int(limit):,}"
