"""Text that can be stored and sent: no lone surrogate or NUL comes in; what is there goes out visibly.

JSON can name half of a surrogate pair (backslash u d800), which no UTF-8 text can hold: once stored it would
end every export, backup and copy that meets it.
"""

import json
import re
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BeforeValidator

REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
TOO_DEEP = "(nested too deeply to be shown)"
_UNSTORABLE = re.compile("[\0\ud800-\udfff]")
_SUSPICIOUS = re.compile(rb"\\u(?:[dD][89a-fA-F]|0000)")
"""Escapes that may name a surrogate or NUL; whether they do only reading the JSON tells."""


def is_storable(text: str) -> bool:
    """True where every database, file and answer can hold this text."""
    return _UNSTORABLE.search(text) is None


def visible(value: Any) -> Any:
    """`value` (as JSON gives it) with every NUL and lone surrogate, in names too, replaced by U+FFFD."""
    try:
        return _visible(value)
    except RecursionError:
        return TOO_DEEP


def _visible(value: Any) -> Any:
    if isinstance(value, str):
        return _UNSTORABLE.sub(REPLACEMENT, value)
    if isinstance(value, dict):
        return {_visible(name): _visible(content) for name, content in value.items()}
    return [_visible(content) for content in value] if isinstance(value, list) else value


VisibleObject = Annotated[dict[str, Any], BeforeValidator(visible)]
"""A stored JSON object as an answer shows it."""


def encoded(text: str) -> bytes:
    """`text` in UTF-8, what cannot be encoded made visible."""
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError:
        return _UNSTORABLE.sub(REPLACEMENT, text).encode("utf-8")


def body_problem(body: bytes) -> str | None:
    """Why a request's body cannot be taken as text; None where it can, or is no JSON (said later)."""
    try:
        body.decode("utf-8")
    except UnicodeDecodeError as error:
        return f"expected text in UTF-8; byte {error.start} is not"
    if b"\0" in body:
        return "expected text in UTF-8 without NUL characters"
    if _SUSPICIOUS.search(body) is None:
        return None
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    for text in _texts(content):
        if not is_storable(text):
            return f"a text holds a character that cannot be stored (half of a pair, or NUL): {text[:40]!a}"
    return None


def _texts(content: Any) -> Iterator[str]:
    """Every text of a JSON value, names included; without recursion, for it comes from anybody."""
    waiting = [content]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            yield value
        elif isinstance(value, dict):
            yield from value
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)
