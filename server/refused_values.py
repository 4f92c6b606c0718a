"""What a request should have held and what it held, in words that repeat no password or token."""

from collections.abc import Mapping
from typing import Any

from experiments.counted import counted
from experiments.wrong_values import expectation, shown

JSON_WORDS = {"a table": "an object", "a text in quotes": "a text"}
"""Words of TOML and what the same is called in a request."""
TIME = "a point in time such as 2026-11-23T09:30:00Z"
FORMS = {
    **dict.fromkeys(
        ("datetime_type", "datetime_parsing", "datetime_from_date_parsing", "timezone_aware"), TIME
    ),
    **dict.fromkeys(("uuid_type", "uuid_parsing"), "a UUID such as 123e4567-e89b-42d3-a456-426614174000"),
}
"""What requests have and declarations have not."""
MAX_NAME = 60


def refused_value(detail: Mapping[str, Any]) -> str:
    """One error of pydantic: the value's place, what was expected and what came.

    A value of the address is shown; of a body only its kind, since it may be secret.

    Examples
    --------
    >>> refused_value({"type": "int_parsing", "loc": ("query", "page"), "input": "two"})
    "query.page: expected a whole number, got 'two'"
    >>> refused_value({"type": "string_type", "loc": ("body", "password"), "input": 12345})
    'body.password: expected a text, got a number'
    """
    location = ".".join(str(part)[:MAX_NAME] for part in detail["loc"])
    return f"{location}: {_problem(detail)}"


def _problem(detail: Mapping[str, Any]) -> str:
    kind, given = detail["type"], detail.get("input")
    if kind == "missing":
        return "this value is required and missing"
    if kind == "extra_forbidden":
        return "there is no value of this name here; leave it out"
    if kind == "json_invalid":
        return f"expected JSON, got something else ({detail['ctx']['error']})"
    expected = FORMS.get(kind) or expectation(detail)
    if expected is None:
        return str(detail["msg"]).removeprefix("Value error, ")
    came = shown(given) if detail["loc"][0] == "query" else _kind(given)
    return f"expected {JSON_WORDS.get(expected, expected)}, got {came}"


def _kind(given: Any) -> str:
    if isinstance(given, str):
        return f"a text of {counted(len(given), 'character')}"
    if isinstance(given, list | tuple):
        return f"a list of {counted(len(given), 'item')}"
    if isinstance(given, bool):
        return "true" if given else "false"
    if given is None:
        return "nothing"
    return "a number" if isinstance(given, int | float) else "an object"
