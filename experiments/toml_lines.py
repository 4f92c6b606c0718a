"""Find the line of a key in TOML text, because the standard parser keeps no positions."""

import re
from collections.abc import Sequence
from functools import lru_cache

from experiments.toml_keys import PART

_HEADER = re.compile(r"^\s*+(\[\[?+)([^\]]++)\]\]?+\s*+(#.*)?$")
_STRING_OR_COMMENT = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL
)
_PART = re.compile(rf"\s*+({PART}|[^.\s]++)\s*+")
_KEY = re.compile(r"^\s*([A-Za-z0-9_\-\"'.]+)\s*=")


def line_of(text: str, location: Sequence[object]) -> int | None:
    """Return the line (from 1) of the deepest part of `location` that stands in `text`, or None.

    `location` is a path of keys and list indices, as pydantic reports it. Arrays of tables (`[[a]]`) count
    their headers; keys inside inline tables are found on the line of the table's own key.
    """
    places = _places(text)
    prefix = list(location)
    while prefix:
        # `[[a]]` has no line of its own where one says `a`: its first element's is meant.
        for key in (tuple(prefix), (*prefix, 0)):
            if key in places:
                return places[key]
        prefix.pop()
    return None


@lru_cache(maxsize=1)
def _places(text: str) -> dict[tuple[object, ...], int]:
    places: dict[tuple[object, ...], int] = {}
    counts: dict[tuple[object, ...], int] = {}
    here: tuple[object, ...] = ()
    depth = 0
    for number, line in enumerate(_without_strings(text).split("\n"), start=1):
        inside = depth > 0
        depth += sum(line.count(bracket) for bracket in "[{") - sum(line.count(bracket) for bracket in "]}")
        if inside:
            continue  # of a value over several lines
        header = _HEADER.match(line)
        if header is not None:
            here = _enter(_split(header[2]), header[1] == "[[", counts)
            places.setdefault(here, number)
            continue
        key = _KEY.match(line)
        if key is not None:
            places.setdefault((*here, *_split(key[1])), number)
    return places


def _without_strings(text: str) -> str:
    """The text with its values' strings and its comments emptied, every line where it was."""

    def emptied(match: re.Match[str]) -> str:
        token = match[0]
        if token.startswith(('"""', "'''")):
            return '""' + "\n" * token.count("\n")
        # A quoted key says what it is called; quoted values do not matter.
        return "" if token.startswith("#") else re.sub(r"[\[\]{}#=]", "_", token)

    return _STRING_OR_COMMENT.sub(emptied, text)


def _enter(keys: list[str], is_array: bool, counts: dict[tuple[object, ...], int]) -> tuple[object, ...]:
    """The path of a table header, with the index of the latest element wherever a key is an array."""
    here: tuple[object, ...] = ()
    for position, key in enumerate(keys):
        here = (*here, key)
        last = position == len(keys) - 1
        if last and is_array:
            counts[here] = counts.get(here, -1) + 1
        if here in counts:
            here = (*here, counts[here])
    return here


def _split(dotted: str) -> list[str]:
    return [part.strip().strip("\"'") for part in _PART.findall(dotted)]
