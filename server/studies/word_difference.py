"""Two texts as one: words that stayed, went and came."""

import re
from collections.abc import Iterator
from difflib import SequenceMatcher
from itertools import groupby
from operator import itemgetter
from typing import Literal

Kind = Literal["same", "gone", "new"]
MAX_WORDS = 4000
"""Of both texts; longer ones are compared line by line, which takes time by their lines."""
_WORD = re.compile(r"\s+|\w+|[^\w\s]")
_LINE = re.compile(r"[^\n]*\n|[^\n]+")


def word_difference(old: str, new: str) -> list[tuple[Kind, str]]:
    """Pieces of `old` and `new` in reading order; what went stands before what came in its place.

    Examples
    --------
    >>> word_difference("a fast clip", "a slow clip")
    [('same', 'a '), ('gone', 'fast'), ('new', 'slow'), ('same', ' clip')]
    """
    before, after = _WORD.findall(old), _WORD.findall(new)
    if len(before) + len(after) > MAX_WORDS:
        before, after = _LINE.findall(old), _LINE.findall(new)
    pieces = groupby(_pieces(before, after), key=itemgetter(0))
    return [(kind, "".join(text for _, text in group)) for kind, group in pieces]


def _pieces(before: list[str], after: list[str]) -> Iterator[tuple[Kind, str]]:
    matcher = SequenceMatcher(None, before, after, autojunk=False)
    for operation, start, end, new_start, new_end in matcher.get_opcodes():
        if operation == "equal":
            yield "same", "".join(before[start:end])
            continue
        if start < end:
            yield "gone", "".join(before[start:end])
        if new_start < new_end:
            yield "new", "".join(after[new_start:new_end])
